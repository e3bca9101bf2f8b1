"""Where a recorded odometry was wrong, which is mended: held and repeated poses, steps, poses that tremble."""

from typing import List, NamedTuple, Tuple

import numpy as np

from mlsm_manager.odometry.continuous import ContinuousOdometry, with_trembling_smoothed
from mlsm_manager.odometry.steps import LEAST_STEP, MotionLimits, Step, StepKind, impossible_steps, standing_stretches
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import rotated, wrapped

_YAW = 2  # column of poses
_COURSE = 20.0  # s before and after a step in which the vehicle shows which way it goes against its heading
_GOES = 1.0  # m in these: less does not tell a course
_FOLLOWS = 0.5  # share of a step of the heading, halfway between a course that turns against it and one that does not
_ANY_HEADING = np.radians(60.0)  # scans that are turned by more lie on nothing: marinas 20 to 40, strafing 90 to 150
_APART = 2.0  # s between the stretches that tell
_TURNS = 200  # between poses, that show whether a heading is measured
_MOSTLY, _FEWEST = 0.5, 20  # share of poses that repeat the one before, and others besides, where an odometry repeats
_SLOW = 0.5  # s: what is repeated for less is as good as told evenly
_TO_AND_FRO = 0.03  # share of neighbouring turns of a measured heading that have opposite signs


class Mended(NamedTuple):
    """track: without what no vehicle does. steps: that were left out. stuck: s, beginnings and ends of headings that
    stood while positions went on; they stay. untold: s, likewise, of stretches in which not even the heading is known.
    """

    track: Track
    steps: List[Step]
    stuck: List[Tuple[float, float]]
    untold: List[Tuple[float, float]]


def mended(track: Track, limits: MotionLimits) -> Mended:
    """Return a track that a vehicle can have gone, and what was mended."""
    stuck = stuck_headings(track)
    track, repeats = _without_repeats(track)
    track, trembling = with_trembling_smoothed(track)
    track, compass = _with_headings_mended(track, limits)
    odometry = ContinuousOdometry(limits)
    odometry.take(track)
    steps = sorted([*repeats, *trembling, *compass, *odometry.steps], key=lambda step: step.time)
    long = [(step.begin, step.time) for step in steps if step.is_too_long]
    untold = [(begin, end) for begin, end in long if _bridged_apart(track, end - begin) > _ANY_HEADING]
    return Mended(odometry.followed(track), steps, stuck, untold)


def _bridged_apart(track: Track, seconds: float) -> float:
    """Return how far [rad] headings usually lie from those that are bridged evenly over `seconds`."""
    starts = np.arange(track.times[0], track.times[-1] - seconds, _APART)
    shares = np.linspace(0.0, 1.0, 5)
    yaws = track.at(starts[:, np.newaxis] + shares * seconds)[..., _YAW]
    turned = wrapped(yaws[:, -1:] - yaws[:, :1])
    return float(np.median(np.abs(wrapped(yaws - yaws[:, :1] - shares * turned)).max(axis=1))) if len(starts) else 0.0


def stuck_headings(track: Track) -> List[Tuple[float, float]]:
    """Return when [s] the heading stood while positions went on, if it is measured elsewhere."""
    if not is_heading_measured(track):
        return []
    return [
        (float(track.times[first]), float(track.times[last]))
        for first, last in standing_stretches(track, _YAW)
        if np.hypot(*np.ptp(track.poses[first : last + 1, :2], axis=0)) > _GOES
    ]


def is_heading_measured(track: Track) -> bool:
    """Return whether the heading trembles as a measured one does, but for where it does not change at all."""
    stands = np.zeros(len(track.times) - 1, dtype=bool)
    for first, last in standing_stretches(track, _YAW):
        stands[first:last] = True
    turns = np.sign(np.diff(track.poses[:, _YAW]))[~stands]
    return len(turns) >= _TURNS and bool(np.mean(turns[1:] * turns[:-1] < 0.0) >= _TO_AND_FRO)


def _without_repeats(track: Track) -> Tuple[Track, List[Step]]:
    """Leave out poses that repeat the one before, where most do: nothing tells between how the vehicle went."""
    same = (np.diff(track.poses, axis=0) == 0.0).all(axis=1)
    for first, last in standing_stretches(track):
        same[first:last] = False
    again = np.append(False, same)
    if np.mean(again) < _MOSTLY or np.count_nonzero(~again) < _FEWEST:
        return track, []
    kept = track.chosen(~again)
    seconds = float(np.median(np.diff(kept.times)))
    if seconds <= _SLOW:
        return track, []
    begin = float(track.times[0])
    return kept, [Step(StepKind.REPEATED, begin, begin + seconds, 0.0, 0.0)]


def _with_headings_mended(track: Track, limits: MotionLimits) -> Tuple[Track, List[Step]]:
    """Turn headings back after a step of the compass that positions did not follow: the course shows it."""
    steps = []
    for number in impossible_steps(track, limits):
        move = track.poses[number] - track.poses[number - 1]
        turn, time = float(wrapped(move[2])), float(track.times[number])
        before = _course(track, time - _COURSE, float(track.times[number - 1]))
        after = _course(track, time, time + _COURSE)
        if wrapped(before - after) * np.sign(turn) > _FOLLOWS * abs(turn) and np.hypot(*move[:2]) < LEAST_STEP[0]:
            poses = track.poses.copy()
            poses[number:, 2] -= turn
            track = track.with_poses(poses)
            steps.append(Step(StepKind.COMPASS_ALONE, time, time, float(np.hypot(*move[:2])), turn))
    return track, steps


def _course(track: Track, start: float, end: float) -> float:
    """Return the direction [rad] in which the vehicle went against its heading; NaN where it hardly went."""
    near = (track.times >= start) & (track.times <= end)
    if np.count_nonzero(near) < 2:
        return np.nan
    poses = track.poses[near]
    moves = rotated(np.diff(poses[:, :2], axis=0), -poses[:-1, 2]).sum(axis=0)
    return float(np.arctan2(moves[1], moves[0])) if np.hypot(*moves) > _GOES else np.nan
