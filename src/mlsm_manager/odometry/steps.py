"""Odometry as a sequence of steps: those that no vehicle can make are found, and replaced by going on as before."""

import threading
from dataclasses import dataclass, replace
from enum import Enum
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.odometry.faults import integrated
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import composed, move_of, seen_from, wrapped
from node_support.parameters import ParameterSet, parameter
from node_support.timing import stretches

LEAST_STEP = np.array([0.3, np.radians(4.0)])  # m, rad: less is noise of a DVL or compass
_LARGEST_ACCELERATION = np.array([5.0, 3.0])  # m/s^2, rad/s^2: half of gravity; from rest to a turn in two seconds
_OUTSTANDING = 8.0  # times the usual step around
_AROUND = 10  # poses before and after that tell what is usual
_NEXT = 0.3  # s: between two poses of a slow odometry that goes on
_AT_ZERO = 0.5  # m: where an odometry is that began again
_HOLD = 2.0  # s without any move from which on a position is held: longer than a slow DVL waits between two velocities
_SHORTEST_STALL = 1.0  # s of equal positions: longer than between two poses
_BEFORE = 1.0  # s before a stall that tell how the vehicle went
_GOES = np.array([0.05, np.radians(2.0)])  # m/s, rad/s: by less it may be stopping
_TO_AND_FRO = 3  # changes of direction in that second
_AS_BEFORE = 0.5  # share of that speed that the last step before a stall has, and the first one after it


@dataclass(frozen=True)
class MotionLimits(ParameterSet):
    """What no vehicle can do."""

    max_speed: float = parameter(
        3.0, "odometry that steps faster is taken to have jumped: the step is left out, and said", unit="m/s", low=0.5,
        high=100.0, tunable=False,
    )  # fmt: skip
    max_turn_rate: float = parameter(
        2.0, "a heading that turns faster is taken to have jumped: the turn is left out, and said", unit="rad/s",
        low=0.2, high=100.0, tunable=False,
    )  # fmt: skip


class StepKind(Enum):
    """What an impossible step looks like; poses that tremble take many."""

    JUMPED = "odometry jumped by {size:.1f} m"
    RESTARTED = "odometry started again from zero, {size:.1f} m off"
    COMPASS = "compass stepped by {turn:.0f} deg"
    TREMBLES = "the compass trembles by about {turn:.0f} deg"
    REPEATED = "the odometry repeats each pose for about {seconds:.1f} s"
    SCATTERS = "reported positions tremble by about {size:.1f} m"
    STALLED = "odometry stalled, and missed {size:.1f} m and {turn:.0f} deg"
    POSITIONS = "positions stood while the heading went on, and missed {size:.1f} m"
    HELD = "odometry held for {seconds:.0f} s, and then right again,"
    HUNG = "odometry hung for {seconds:.0f} s, and missed how far the vehicle went,"


_LONGEST_STALL = 30.0  # s: a vehicle may have done anything meanwhile
_LONGEST_HELD = 300.0  # s: nobody keeps poses for longer to see how a stretch of equal ones ends
_MAY_STAND = 10.0  # s: poses that are equal for longer may be those of a vehicle that stands, if it came to a stop


@dataclass(frozen=True)
class Step:
    """An impossible step. begin, time: s, of the pose before it and of the first one after it. size: m. turn: rad.

    lost: s, in which nothing tells how the vehicle went.
    """

    kind: StepKind
    begin: float
    time: float
    size: float
    turn: float
    lost: float = 0.0

    @property
    def is_too_long(self) -> bool:
        """Whether the vehicle may have done anything meanwhile."""
        return self.lost >= _LONGEST_STALL

    @property
    def text(self) -> str:
        """What happened, without the time."""
        return self.kind.value.format(size=self.size, turn=np.degrees(self.turn), seconds=self.time - self.begin)


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
        """Forget everything, because time jumped."""
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
        impossible = impossible_steps(track, self._limits).tolist()
        stalled = {stall.end: stall for stall in stalls(track, impossible, self._limits.max_speed)}
        for number in sorted({*impossible, *stalled}):
            if number >= known and not self._stood_until(*track.times[number - 1 : number + 1]):
                if number in stalled:
                    self._bridge(track, stalled[number], track.times[known - 1])
                else:
                    self._leave_out(track, number)
        self._newest = track.chosen(slice(min(_oldest_that_tells(track), max(len(track.times) - _AROUND, 0)), None))
        self._known = True

    def _stood_until(self, before: float, after: float) -> bool:
        """Return whether a clock that had stood went on between two times [s]."""
        return any(before < end and after > begin for begin, end in list(self.stood))

    def _bridge(self, track: Track, stall: "Stall", taken_until: float) -> None:
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
        self._put(_kind(after, step, self._limits), track.times[[number - 1, number]], step, after)

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


def _oldest_that_tells(track: Track) -> int:
    """Return from which pose on a track tells whether its end is a stall, and how the vehicle went just before."""
    stands = np.flatnonzero(_moves(track))[-1:] + 1
    begin = track.times[stands[0]] if stands.size else track.times[0]
    longest = track.times[-1] - _LONGEST_HELD
    return int(np.searchsorted(track.times, max(begin, longest) - _BEFORE))


class Stall(NamedTuple):
    """begin, end: of the poses, the first that stood and the first after it. missed, usual: (3,) in base_link, how the
    vehicle went meanwhile, and in a step as long as the last one, if it went on as before. kind: STALLED where the
    heading stood too, else POSITIONS; HELD or HUNG where it jumped afterwards. lost: s, in which nothing tells how the
    vehicle went.
    """

    begin: int
    end: int
    missed: np.ndarray
    usual: np.ndarray
    kind: StepKind
    lost: float


def stalls(track: Track, impossible: Sequence[int], max_speed: float) -> List[Stall]:
    """Return where the position stood for seconds, though no vehicle stops and starts so suddenly; without positions,
    where the heading did. impossible: numbers of poses that no vehicle reaches from the one before.
    """
    jumps = [(first, last) for first, last in stretches(_stands(track)) if last + 1 in impossible]
    held = [stall for stall in (_held(track, *one, max_speed) for one in jumps) if stall is not None]
    ends = {len(track.times), *(stall.end for stall in held)}
    others = (_stall(track, *one) for one in stretches(~_moves(track)) if one[1] + 1 not in ends)
    return [*held, *(stall for stall in others if stall is not None)]


def _stands(track: Track) -> np.ndarray:
    """Return which steps (m - 1,) change nothing."""
    return (np.diff(track.poses, axis=0) == 0.0).all(axis=1)


def _moves(track: Track) -> np.ndarray:
    """Return which steps (m - 1,) change the position; without positions, which ones change the heading."""
    moves = np.diff(track.poses, axis=0) != 0.0
    return (moves[:, :2] if moves[:, :2].any() else moves[:, 2:]).any(axis=1)


def _held(track: Track, first: int, last: int, max_speed: float) -> Optional[Stall]:
    """Return the stall of a pose that stood and then jumped, if only as far as a vehicle goes meanwhile.

    Where only the heading jumped nothing tells how far the vehicle went. Poses that stood from the beginning on may be
    those of a vehicle at rest.
    """
    seconds, poses = float(track.times[last] - track.times[first]), track.poses
    missed = seen_from(poses[last], poses[last + 1])
    distance = float(np.hypot(*missed[:2]))
    if first == 0 or not _MAY_STAND <= seconds < _LONGEST_HELD or distance > max_speed * seconds:
        return None
    is_right = distance > LEAST_STEP[0] or not np.ptp(poses[:, :2], axis=0).any()
    kind, lost = (StepKind.HELD, 0.0) if is_right else (StepKind.HUNG, seconds)
    return Stall(first, last + 1, missed, missed, kind, lost)


def _stall(track: Track, first: int, last: int) -> Optional[Stall]:
    times, poses, rates = track.times, track.poses, _rates_before(track, first)
    kind = StepKind.POSITIONS if np.ptp(poses[first : last + 1, 2]) else StepKind.STALLED
    if not _SHORTEST_STALL <= times[last] - times[first] < _LONGEST_STALL or len(rates) < 2:
        return None
    step, seconds = times[last + 1] - times[last], float(times[last + 1] - times[first])
    usual, again = np.median(rates, axis=0), seen_from(poses[last], poses[last + 1]) / step
    stops = _stops_at_once(rates)
    if kind is StepKind.POSITIONS:
        missed = _steered(usual * stops[0], again, times[first : last + 2], poses[first : last + 2, 2])
        goes = stops[0] or _speeds(again)[0] > _GOES[0]
    else:
        missed = usual * seconds
        at_once, trembles = (stops & (_speeds(again) > _AS_BEFORE * _speeds(usual))).any(), _trembles(rates[:, 2])
        goes = at_once or trembles if times[last] - times[first] < _MAY_STAND else at_once and trembles
    return Stall(first, last + 1, missed, usual * step, kind, seconds) if goes else None


def _rates_before(track: Track, first: int) -> np.ndarray:
    """Return how fast (k, 3) the vehicle went in base_link, step by step, in the second before pose `first`."""
    start = int(np.searchsorted(track.times, track.times[first] - _BEFORE))
    times, poses = track.times[start : first + 1], track.poses[start : first + 1]
    return seen_from(poses[:-1], poses[1:]) / np.diff(times)[:, np.newaxis]


def _stops_at_once(rates: np.ndarray) -> np.ndarray:
    """Return whether a vehicle that went by `rates` (k, 3) went and turned (2,) in the last step as in those before."""
    usual = _speeds(np.median(rates, axis=0))
    return (usual > _GOES) & (_speeds(rates[-1]) > _AS_BEFORE * usual)


def _steered(before: np.ndarray, after: np.ndarray, times: np.ndarray, headings: np.ndarray) -> np.ndarray:
    """Return the move (3,) of a vehicle with headings (m,) whose velocity in base_link goes over to another (3,)."""
    durations = np.diff(times)
    share = (np.cumsum(durations) - durations / 2.0) / durations.sum()
    steps = durations[:, np.newaxis] * (before + share[:, np.newaxis] * (after - before))
    steps[:, 2] = np.diff(headings)
    return integrated(np.zeros(3), steps)[-1]


def seconds_untold(
    known_times: np.ndarray, known_poses: np.ndarray, times: np.ndarray, poses: np.ndarray, lost: np.ndarray
) -> np.ndarray:
    """Return in which part (m,) [s] of the steps to the newest `poses` (m, 3) nothing tells how the vehicle went.

    Positions are lost, as where a stall was bridged, or they do not change at all while the heading does: such a stall
    was too long to be bridged, or the vehicle is at rest. known: (n,) s and (n, 3), before. lost: (m,) s, see Track.
    """
    near = slice(max(int(np.searchsorted(known_times, times[0] - _HOLD)) - 1, 0), None)
    count = len(known_times[near])
    all_times, all_poses = np.append(known_times[near], times), np.concatenate([known_poses[near], poses])
    before = np.searchsorted(all_times, times - _HOLD, side="right") - 1
    moves = poses - all_poses[np.maximum(before, 0)]
    is_held = (before >= 0) & (moves[:, :2] == 0.0).all(axis=1) & (moves[:, 2] != 0.0)
    steps = np.diff(all_times, prepend=all_times[0])[count:]
    return np.where(is_held, steps, lost)


def _trembles(turns: np.ndarray) -> bool:
    """Return whether a heading is one that is measured: such a one turns to and fro and never stands."""
    return bool((turns != 0.0).all() and np.count_nonzero(np.diff(np.sign(turns))) >= _TO_AND_FRO)


def _speeds(rates: np.ndarray) -> np.ndarray:
    return np.array([np.hypot(*rates[:2]), abs(rates[2])])


def impossible_steps(track: Track, limits: MotionLimits) -> np.ndarray:
    """Return the numbers (k,) of the poses that no vehicle reaches from the one before.

    The step is faster than the limits, or so fast between slow ones that no vehicle accelerates and stops so.
    """
    if len(track.times) < 2:
        return np.empty(0, dtype=int)
    durations = np.diff(track.times)[:, np.newaxis]
    moves = np.diff(track.poses, axis=0)
    steps = np.column_stack([np.hypot(*moves[:, :2].T), np.abs(wrapped(moves[:, 2]))])
    if not (steps > LEAST_STEP).any():
        return np.empty(0, dtype=int)
    speeds = steps / durations
    beside = np.maximum(np.roll(speeds, 1, axis=0), np.roll(speeds, -1, axis=0))
    beside[0], beside[-1] = speeds[min(1, len(speeds) - 1)], np.inf
    sudden = speeds > beside + _LARGEST_ACCELERATION * durations
    too_fast = speeds > np.array([limits.max_speed, limits.max_turn_rate])
    found = (steps > LEAST_STEP) & (too_fast | sudden)
    for number in np.flatnonzero(found.any(axis=1)):
        near = np.delete(steps[max(number - _AROUND, 0) : number + _AROUND + 1], min(number, _AROUND), axis=0)
        if len(near):
            found[number] &= steps[number] > _OUTSTANDING * np.median(near, axis=0)
    return np.flatnonzero(found.any(axis=1)) + 1


def _kind(after: np.ndarray, step: np.ndarray, limits: MotionLimits) -> StepKind:
    if np.hypot(*step[:2]) < LEAST_STEP[0]:
        return StepKind.COMPASS
    return StepKind.RESTARTED if np.hypot(*after[:2]) < _AT_ZERO else StepKind.JUMPED
