"""Odometry as a sequence of steps, and which of them no vehicle can make."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import wrapped
from node_support.parameters import ParameterSet, parameter

LEAST_STEP = np.array([0.3, np.radians(4.0)])  # m, rad: less is noise of a DVL or compass
_LARGEST_ACCELERATION = np.array([5.0, 3.0])  # m/s^2, rad/s^2: half of gravity; from rest to a turn in two seconds
_OUTSTANDING = 8.0  # times the usual step around
AROUND = 10  # poses before and after that tell what is usual
_AT_ZERO = 0.5  # m: where an odometry is that began again


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


LONGEST_STALL = 30.0  # s: a vehicle may have done anything meanwhile


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
        return self.lost >= LONGEST_STALL

    @property
    def text(self) -> str:
        return self.kind.value.format(size=self.size, turn=np.degrees(self.turn), seconds=self.time - self.begin)


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
        near = np.delete(steps[max(number - AROUND, 0) : number + AROUND + 1], min(number, AROUND), axis=0)
        if len(near):
            found[number] &= steps[number] > _OUTSTANDING * np.median(near, axis=0)
    return np.flatnonzero(found.any(axis=1)) + 1


def kind_of(after: np.ndarray, step: np.ndarray, limits: MotionLimits) -> StepKind:
    if np.hypot(*step[:2]) < LEAST_STEP[0]:
        return StepKind.COMPASS
    return StepKind.RESTARTED if np.hypot(*after[:2]) < _AT_ZERO else StepKind.JUMPED
