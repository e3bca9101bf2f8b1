"""Odometry as a sequence of steps: which of them no vehicle can make; and poses that stand though the vehicle went on,
and what nobody knows of its way meanwhile.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.odometry.changed_tracks import integrated
from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import seen_from, wrapped
from node_support.parameters import ParameterSet, parameter
from node_support.timing import stretches

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
    COMPASS_ALONE = "compass stepped by {turn:.0f} deg, beside positions that are right,"
    TREMBLES = "the compass trembles by about {turn:.0f} deg"
    REPEATED = "the odometry repeats each pose for about {seconds:.1f} s"
    SCATTERS = "reported positions tremble by about {size:.1f} m"
    STALLED = "odometry stalled, and missed {size:.1f} m and {turn:.0f} deg"
    POSITIONS = "positions stood while the heading went on, and missed {size:.1f} m"
    HELD = "odometry held for {seconds:.0f} s, and then right again,"
    HUNG = "odometry hung for {seconds:.0f} s, and missed how far the vehicle went,"


JUMPS_AFTER_STANDING = (StepKind.HELD, StepKind.HUNG)
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
    def misread(self) -> Optional[MotionFault]:
        """What is wrong without the step if positions went otherwise beside it; None where nothing else is likely.

        The course of a vehicle wanders by as much as small steps of its compass.
        """
        if self.kind is StepKind.COMPASS:
            return MotionFault(FaultKind.STEP_ALONE, self.time, (self.turn,))
        if self.kind is StepKind.COMPASS_ALONE:
            return MotionFault(FaultKind.STEP_FOLLOWED, self.time, (-self.turn,))
        return None

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


_SHORTEST_STALL = 1.0  # s of equal positions: longer than between two poses
_STANDS_FOR = 10.0  # s of equal poses: longer than any odometry waits between two; the vehicle may have come to a stop
_LONGEST_HELD = 300.0  # s: nobody keeps poses for longer to see how a stretch of equal ones ends
_HOLD = 2.0  # s without any move from which on a position is held: longer than a slow DVL waits between two velocities
_BEFORE = 1.0  # s before a stall that tell how the vehicle went
_GOES = np.array([0.05, np.radians(2.0)])  # m/s, rad/s: by less it may be stopping
_TO_AND_FRO = 3  # changes of direction in that second
_AS_BEFORE = 0.5  # share of that speed that the last step before a stall has, and the first one after it


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
    jumps = [(first, last) for first, last in standing_stretches(track) if last + 1 in impossible]
    held = [stall for stall in (_held(track, *one, max_speed) for one in jumps) if stall is not None]
    ends = {len(track.times), *(stall.end for stall in held)}
    others = (_stall(track, *one) for one in stretches(~_moves(track)) if one[1] + 1 not in ends)
    return [*held, *(stall for stall in others if stall is not None)]


def standing_stretches(track: Track, first_column: int = 0) -> Iterator[Tuple[int, int]]:
    """Yield first and last number of stretches of ten seconds or more in which the pose does not change at all.

    A heading that is measured trembles, so that a pose stands only where nobody measures it, or in a simulation.
    first_column: 2 for stretches in which the heading does not change.
    """
    for first, last in stretches((np.diff(track.poses[:, first_column:], axis=0) == 0.0).all(axis=1)):
        if track.times[last] - track.times[first] >= _STANDS_FOR:
            yield first, last


def stands_suddenly(track: Track, first: int, last: int) -> bool:
    """Return whether a position that stands from pose `first` to `last` stops or starts as no vehicle does."""
    rates = _rates_before(track, first)
    if len(rates) < 2:
        return False
    usual = np.median(rates, axis=0)
    starts = (_speeds(usual) > _GOES) & _goes_on_at_once(track, last, usual)
    return bool(_stops_at_once(rates)[0] or starts[0])


def oldest_that_tells(track: Track) -> int:
    """Return from which pose on a track tells whether its end is a stall, and how the vehicle went just before."""
    stands = np.flatnonzero(_moves(track))[-1:] + 1
    begin = track.times[stands[0]] if stands.size else track.times[0]
    longest = track.times[-1] - _LONGEST_HELD
    return int(np.searchsorted(track.times, max(begin, longest) - _BEFORE))


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
    if first == 0 or seconds >= _LONGEST_HELD or distance > max_speed * seconds:
        return None
    is_right = distance > LEAST_STEP[0] or not track.reports_positions
    kind, lost = (StepKind.HELD, 0.0) if is_right else (StepKind.HUNG, seconds)
    return Stall(first, last + 1, missed, missed, kind, lost)


def _stall(track: Track, first: int, last: int) -> Optional[Stall]:
    times, poses, rates = track.times, track.poses, _rates_before(track, first)
    kind = StepKind.POSITIONS if np.ptp(poses[first : last + 1, 2]) else StepKind.STALLED
    if not _SHORTEST_STALL <= times[last] - times[first] < LONGEST_STALL or len(rates) < 2:
        return None
    step, seconds = times[last + 1] - times[last], float(times[last + 1] - times[first])
    usual, again = np.median(rates, axis=0), seen_from(poses[last], poses[last + 1]) / step
    stops = _stops_at_once(rates)
    if kind is StepKind.POSITIONS:
        missed = _steered(usual * stops[0], again, times[first : last + 2], poses[first : last + 2, 2])
        goes = stops[0] or _speeds(again)[0] > _GOES[0]
    else:
        missed = usual * seconds
        at_once, turns = (stops & _goes_on_at_once(track, last, usual)).any(), rates[:, 2]
        # A heading that is measured turns to and fro and never stands.
        trembles = (turns != 0.0).all() and np.count_nonzero(np.diff(np.sign(turns))) >= _TO_AND_FRO
        goes = at_once or trembles if times[last] - times[first] < _STANDS_FOR else at_once and trembles
    return Stall(first, last + 1, missed, usual * step, kind, seconds) if goes else None


def _rates_before(track: Track, first: int) -> np.ndarray:
    """Return how fast (k, 3) the vehicle went in base_link, step by step, in the second before pose `first`."""
    start = int(np.searchsorted(track.times, track.times[first] - _BEFORE))
    times, poses = track.times[start : first + 1], track.poses[start : first + 1]
    return seen_from(poses[:-1], poses[1:]) / np.diff(times)[:, np.newaxis]


def _goes_on_at_once(track: Track, last: int, usual: np.ndarray) -> np.ndarray:
    """Return whether a vehicle goes and turns (2,) in the step after pose `last` as by `usual` (3,)."""
    if last + 1 == len(track.times):
        return np.array([False, False])
    again = seen_from(track.poses[last], track.poses[last + 1]) / (track.times[last + 1] - track.times[last])
    return _speeds(again) > _AS_BEFORE * _speeds(usual)


def _stops_at_once(rates: np.ndarray) -> np.ndarray:
    """Return whether a vehicle that went by `rates` (k, 3) went and turned (2,) in the last steps as in those before.

    In the last two: of a pose the position may stand before the heading does.
    """
    usual = _speeds(np.median(rates, axis=0))
    last = np.maximum(_speeds(rates[-1]), _speeds(rates[-2]))
    return (usual > _GOES) & (last > _AS_BEFORE * usual)


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


def _speeds(rates: np.ndarray) -> np.ndarray:
    return np.array([np.hypot(*rates[:2]), abs(rates[2])])
