"""An odometry as it comes: how far it changed, and one that never jumps, without what trembles.

Steps that no vehicle can make are left out, and stalls are bridged.
"""

import threading
from dataclasses import replace
from typing import List, Sequence, Tuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from mlsm_manager.odometry.steps import (
    AROUND,
    JUMPS_AFTER_STANDING,
    LEAST_STEP,
    MotionLimits,
    Stall,
    Step,
    StepKind,
    impossible_steps,
    kind_of,
    oldest_that_tells,
    stalls,
)
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import composed, move_of, seen_from, wrapped

_NEXT = 0.3  # s: between two poses of a slow odometry that goes on
_COARSE = 0.03  # m: positions that are rounded to less stand for no second while the vehicle goes
_CHANGES, _FEWEST = 100, 6  # the newest ones along x or y, and how many tell whether positions are rounded
_EXACT = 1e-3  # of what they are rounded to


class Rounding:
    """Tells from the changes of positions whether these are rounded: then all are multiples of one length."""

    def __init__(self) -> None:
        self._changes = np.empty(0)

    def learn(self, poses: np.ndarray) -> None:
        """Learn poses (m, 3) that follow each other."""
        changes = np.abs(np.diff(poses[:, :2], axis=0)).ravel()
        self._changes = np.append(self._changes, changes[changes > 0.0])[-_CHANGES:]

    @property
    def is_coarse(self) -> bool:
        """Whether a position that stands for seconds may be that of a vehicle that goes on."""
        if len(self._changes) < _FEWEST or self._changes.min() < _COARSE:
            return False
        multiples = self._changes / self._changes.min()
        return bool(np.abs(multiples - np.round(multiples)).max() < _EXACT)


class ContinuousOdometry:
    """Follows T_odom_base and says what has to be put before it, so that it never jumps.

    A step is left out in the vehicle's frame: it goes on with the speed of the step before. So positions and headings
    after a step hang together as they were reported. While the odometry stalls it goes on likewise. What it reports at
    once after its clock has stood is no step.

    stood: from when to when [s] its stamps went on after they had stood. trembling: at most one of
    positions and one of headings.

    Safe to use from several threads: one gives it scans, another asks for what holds now.
    """

    def __init__(self, limits: MotionLimits) -> None:
        self._limits = limits
        self._lock = threading.Lock()
        self.stood: Sequence[Tuple[float, float]] = ()
        self.clear()

    def clear(self) -> None:
        self._rounding = Rounding()
        self.steps: List[Step] = []
        self.trembling: List[Step] = []
        self._starts = [-np.inf]
        self._fixes = [np.zeros(3)]
        self._newest = Track(np.zeros(1), np.zeros((1, 3)))
        self._known = False
        self._usual = self._expected = np.zeros(3)

    def take(self, track: Track) -> None:
        """Learn the poses of `track` that are newer than those known."""
        with self._lock:
            self._take(track)

    def _take(self, track: Track) -> None:
        if self._known:
            newer = track.times > self._newest.times[-1]
            if not newer.any():
                return
            times = np.append(self._newest.times, track.times[newer])
            track = Track(times, np.concatenate([self._newest.poses, track.poses[newer]]))
            known = len(self._newest.times)
        else:
            known = 1
        self._rounding.learn(track.poses[known - 1 :])
        impossible = impossible_steps(track, self._limits).tolist()
        stalled = {stall.end: stall for stall in stalls(track, impossible, self._limits.max_speed)}
        if stalled and self._rounding.is_coarse:
            stalled = {end: stall for end, stall in stalled.items() if stall.kind in JUMPS_AFTER_STANDING}
        for number in sorted({*impossible, *stalled}):
            if number >= known and not self._stood_until(*track.times[number - 1 : number + 1]):
                if number in stalled:
                    self._bridge(track, stalled[number], track.times[known - 1])
                else:
                    self._leave_out(track, number)
        self._newest = track.chosen(slice(min(oldest_that_tells(track), max(len(track.times) - AROUND, 0)), None))
        self._known = True

    def _stood_until(self, before: float, after: float) -> bool:
        """Return whether a clock that had stood went on between two times [s]."""
        return any(before < end and after > begin for begin, end in list(self.stood))

    def _bridge(self, track: Track, stall: Stall, taken_until: float) -> None:
        """Let the odometry go on while it stalled; where it jumped afterwards, by as much as it jumped.

        Poses until `taken_until` [s] were taken for true: only after that is lost what goes on as before.
        """
        before, after = track.poses[stall.begin], track.poses[stall.end]
        step, missed, lost = seen_from(before, after), stall.missed.copy(), stall.lost
        if np.hypot(*(step - stall.usual)[:2]) > LEAST_STEP[0]:
            missed[:2], lost = step[:2], 0.0
        if stall.kind is not StepKind.HUNG:
            lost = min(lost, float(track.times[stall.end]) - taken_until)
        if abs(wrapped(step[2] - stall.usual[2])) > LEAST_STEP[1]:
            missed[2] = step[2]
        self._expected = composed(composed(self._fixes[-1], before), missed)
        self._put(stall.kind, track.times[[stall.begin, stall.end]], missed, after, lost)

    def _leave_out(self, track: Track, number: int) -> None:
        """Let the odometry go on without the step to pose `number`."""
        before, after = track.poses[number - 1], track.poses[number]
        if number > 1 and track.times[number - 1] not in self._starts:
            duration = track.times[number - 1] - track.times[number - 2]
            share = min((track.times[number] - track.times[number - 1]) / duration, 1.0)
            self._usual = share * seen_from(track.poses[number - 2], before)
        step = after - before
        # Where the last pose was a step itself its place is known better than from a large step and back.
        place = self._expected if self._starts[-1] == track.times[number - 1] else composed(self._fixes[-1], before)
        self._expected = composed(place, self._usual)
        self._put(kind_of(after, step, self._limits), track.times[[number - 1, number]], step, after)

    def _put(
        self, kind: StepKind, times: np.ndarray, step: np.ndarray, after: np.ndarray, lost: float = 0.0
    ) -> None:  # fmt: skip
        """Put the pose `after` a step (3,) to where it is expected; times: (2,) s, of the poses before and after it."""
        self.steps.append(Step(kind, *times.tolist(), float(np.hypot(*step[:2])), float(wrapped(step[2])), lost))
        # The fix comes first: others search the starts.
        self._fixes.append(move_of(after, self._expected))
        self._starts.append(float(times[1]))

    def goes_on_at(self, pose: np.ndarray) -> bool:
        """Return whether T_odom_base `pose` (3,) is where the vehicle was just before, so that only a clock jumped."""
        if not self._known:
            return False
        move = pose - self._newest.poses[-1]
        limits = self._limits
        return bool(
            np.hypot(*move[:2]) < _NEXT * limits.max_speed and abs(wrapped(move[2])) < _NEXT * limits.max_turn_rate
        )

    def fixes(self, times: np.ndarray) -> np.ndarray:
        """Return T_continuous_odom (..., 3) at `times` (...) s."""
        # The starts first: another thread may take a step meanwhile, and adds its fix before its start.
        numbers = np.searchsorted(self._starts, times, side="right") - 1
        return np.array(self._fixes)[numbers]

    def followed(self, track: Track) -> Track:
        """Return T_continuous_base of a track that was taken, without what was interpolated within a step."""
        if not self.steps:
            return track
        kept, lost = np.ones(len(track.times), dtype=bool), track.lost.copy()
        for step in list(self.steps):
            kept &= (track.times <= step.begin) | (track.times >= step.time)
            lost[track.times == step.time] += step.lost
        if not kept.any():
            return track
        mended = replace(track, poses=composed(self.fixes(track.times), track.poses), lost=lost)
        return mended.chosen(kept)


_UNMOVED = 0.05  # m: a position that moves by less never changed, but for rounding and lever arms of a tilting base
_UNTURNED = 0.02  # rad: a compass at rest says less, a vehicle that travels turns more


class ReportedMotion:
    """How far T_odom_base changed since it was first known: what an odometry tells of itself.

    extent: m, of the positions along x or y. turned: rad, between the most different headings.
    """

    def __init__(self) -> None:
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._first_yaw = np.nan

    def learn(self, track: Track) -> None:
        poses = track.poses.copy()
        if np.isnan(self._first_yaw):
            self._first_yaw = poses[0, 2]
        poses[:, 2] = wrapped(poses[:, 2] - self._first_yaw)
        self._low = np.minimum(self._low, poses.min(axis=0))
        self._high = np.maximum(self._high, poses.max(axis=0))

    @property
    def extent(self) -> float:
        """By how much positions changed, m."""
        return float(np.max(self._high[:2] - self._low[:2]))

    @property
    def turned(self) -> float:
        """By how much the heading changed, rad; at most a turn."""
        return float(self._high[2] - self._low[2])

    @property
    def has_positions(self) -> bool:
        return self.extent > _UNMOVED

    @property
    def has_headings(self) -> bool:
        return self.turned > _UNTURNED

    @property
    def only_turns(self) -> bool:
        """Whether headings changed, and positions never did: nobody reports these."""
        return self.has_headings and not self.has_positions


# Positions and headings that each err by themselves, as no vehicle moves.
_TREMBLES = np.array([0.1, 0.1, np.radians(2.0)])  # m, rad: of a pose by itself; DVLs and compasses have a tenth of it
_MOST = 20.0  # m, rad: beyond, poses do not tremble but make no sense
_POSES = 100  # that tell it
_OPPOSED = 0.6  # share of neighbours on opposite sides of a smooth path: .73 by noise, half in waves and turns
_STEADY = 1e-3  # m, rad: noise of poses that do not tremble
_AGILITY = np.array([0.1, 0.1, 0.05])  # m/s/sqrt(s), rad/s/sqrt(s): random walk of a small vehicle's speeds
_OF_NORMAL = 1.48  # standard deviation of normal noise over its median size, which steps do not change


def with_trembling_smoothed(track: Track) -> Tuple[Track, List[Step]]:
    """Return a track whose positions and headings were smoothed where they tremble, and by how much they did; none
    where nowhere.
    """
    poses, noise = track.poses.copy(), np.column_stack([_noise(track.times, column) for column in track.poses.T])
    trembles = (noise > _TREMBLES) & (noise < _MOST)
    for axis in np.flatnonzero(trembles.any(axis=0)):
        own = trembles[:, axis]
        smoothed = _smoothed(track.times, poses[:, axis], np.where(own, noise[:, axis], _STEADY), _AGILITY[axis])
        poses[own, axis] = smoothed[own]
    steps, moves, turns = [], trembles[:, :2].any(axis=1), trembles[:, 2]
    if moves.any():
        size = float(np.median(np.hypot(*noise[moves, :2].T)) / np.sqrt(2.0))
        time = float(track.times[np.argmax(moves)])
        steps.append(Step(StepKind.SCATTERS, time, time, size, 0.0))
    if turns.any():
        turn, time = float(np.median(noise[turns, 2])), float(track.times[np.argmax(turns)])
        steps.append(Step(StepKind.TREMBLES, time, time, 0.0, turn))
    return (track.with_poses(poses), steps) if steps else (track, [])


def _noise(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the standard deviation (m,) of each of `values` (m,) by itself, against those just before and after it.

    Zero where they go on as a vehicle does: then errors of neighbours are as often on one side as on both.
    """
    noise, steps = np.zeros(len(times)), np.diff(times)
    share = steps[1:] / (steps[:-1] + steps[1:])
    expected = share * values[:-2] + (1.0 - share) * values[2:]
    apart = (values[1:-1] - expected) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    edges = np.linspace(0, len(apart), len(apart) // _POSES + 1).astype(int)
    for first, last in zip(edges[:-1], edges[1:]):
        near = apart[first:last]
        if np.mean(near[1:] * near[:-1] < 0.0) > _OPPOSED:
            # Besides its own poses a stretch has the first and the last one of the track, which have one neighbour.
            own = slice(first and first + 1, last + 1 if last < len(apart) else None)
            noise[own] = _OF_NORMAL * np.median(np.abs(near))
    return noise


def _smoothed(times: np.ndarray, values: np.ndarray, noise: np.ndarray, agility: float) -> np.ndarray:
    """Return what is likeliest (m,) by `values` (m,) that err by `noise` (m,), if its rate walks by `agility`."""
    steps = np.diff(times)
    slopes = [1.0 / steps[:-1], -1.0 / steps[:-1] - 1.0 / steps[1:], 1.0 / steps[1:]]
    changes = scipy.sparse.diags(slopes, [0, 1, 2], shape=(len(times) - 2, len(times)))
    weights = scipy.sparse.diags(2.0 / (steps[:-1] + steps[1:]) / agility**2)
    information = scipy.sparse.diags(noise**-2.0) + changes.T @ weights @ changes
    return scipy.sparse.linalg.spsolve(information.tocsc(), values / noise**2)
