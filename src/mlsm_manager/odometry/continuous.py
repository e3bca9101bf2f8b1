"""Odometry that never jumps: steps that no vehicle can make are left out, and stalls are bridged."""

import threading
from dataclasses import replace
from typing import List, Sequence, Tuple

import numpy as np

from mlsm_manager.odometry.stalls import Stall, oldest_that_tells, stalls
from mlsm_manager.odometry.steps import AROUND, LEAST_STEP, MotionLimits, Step, StepKind, impossible_steps, kind_of
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import composed, move_of, seen_from, wrapped

_NEXT = 0.3  # s: between two poses of a slow odometry that goes on


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
