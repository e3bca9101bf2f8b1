"""A vehicle that moves while its odometry, or the person who maps it, says that it stands."""

from typing import List, Sequence, Tuple

import numpy as np

from mlsm_manager.odometry.mending import is_heading_measured, stuck_headings
from mlsm_manager.odometry.steps import standing_stretches, stands_suddenly
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.causes import Cause, of_stuck
from mlsm_manager.self_check.scan_pairs import FEWEST, MOST, near_pairs
from node_support.geometry import wrapped

_FEWEST_PAIRS = 3
_CERTAIN = 100.0  # nats: a heading that is measured trembles, so that the pose itself says that nobody measured it
_FARTHER = 1.4  # times as far as pairs of scans elsewhere lie apart
_AT_ONE_PLACE = 0.4  # times as far: simulated vehicles that stopped had .06 to .25, one that went along a wall .57
_REST, _AT_REST = 10.0, 0.3  # s, and m within which a vehicle that rests stays meanwhile
_PAUSE = 1.0  # s: longer than between two changes of a pose that is measured
_SPEED = 0.3  # m/s: the usual speed of a small vehicle
_ANY_TURN = np.pi / 2.0  # rad: the mean size of a turn that may be any


def standing_causes(scans: Sequence[Scan], track: Track, path: np.ndarray) -> List[Cause]:
    """Return the stretches in which T_odom_base stands while scans do not lie on each other as they do elsewhere.

    Where it tells no positions, those in which it stands though the vehicle went on. path: (m, >= 2) m, the way that it
    went by the solver.
    """
    stretches, is_measured = list(standing_stretches(track)), is_heading_measured(track)
    if not track.reports_positions:
        stuck = stuck_headings(track.with_poses(np.column_stack([path[:, :2], track.poses[:, 2]])))
        if stuck:
            return [of_stuck(*one) for one in stuck]
    # Without positions a heading that never trembles stands on every straight way.
    if not stretches or not (track.reports_positions or is_measured):
        return []
    (times, apart), spans = _pairs(scans), track.times[np.array(stretches)]
    inside = [apart[(times[:, 0] >= begin) & (times[:, 1] <= end)] for begin, end in spans]
    # What such a stretch moved unseen lies between the two scans of a pair that reaches into it.
    outside = [(times[:, 1] <= begin) | (times[:, 0] >= end) for begin, end in spans]
    elsewhere = apart[np.all(outside, axis=0)]
    return [
        _cause(*span, within, elsewhere, _missed_turn(track, *span))
        for stretch, span, within in zip(stretches, spans, inside)
        if (_seems_frozen(track, stretch, within, elsewhere) if is_measured else _moves(within, elsewhere))
    ]


def _moves(within: np.ndarray, elsewhere: np.ndarray) -> bool:
    """Return whether scans lie farther apart than elsewhere, where they are known to be of other places."""
    return _lie_apart(within, elsewhere, _FEWEST_PAIRS, _FARTHER)


def _seems_frozen(track: Track, stretch: Tuple[int, int], within: np.ndarray, elsewhere: np.ndarray) -> bool:
    """Return whether a pose that elsewhere trembles stands though scans do not show that the vehicle does.

    Along a straight wall they lie on each other wherever the vehicle goes. Where the stretch is too short for a pair of
    scans, it must begin and end as suddenly as no vehicle stops. A pose that
    trembles at another rest of the vehicle is frozen wherever it stands, but at the beginning: the odometry may not
    have begun then.
    """
    if stretch[0] > 0 and _trembles_at_rest(track):
        return True
    return _lie_apart(within, elsewhere, 1, _AT_ONE_PLACE) if len(within) else stands_suddenly(track, *stretch)


def _trembles_at_rest(track: Track) -> bool:
    """Return whether the pose goes on changing somewhere at rest; False where no positions are reported."""
    if not track.reports_positions:
        return False
    changed = track.times[1:][(np.diff(track.poses, axis=0) != 0.0).any(axis=1)]
    for begin in np.arange(track.times[0], track.times[-1] - _REST, _REST):
        near = (track.times >= begin) & (track.times <= begin + _REST)
        if not near.any():  # poses were left out there
            continue
        rests = np.hypot(*np.ptp(track.poses[near, :2], axis=0)) < _AT_REST
        within = changed[(changed > begin) & (changed < begin + _REST)]
        if rests and np.diff(within, prepend=begin, append=begin + _REST).max() < _PAUSE:
            return True
    return False


def _lie_apart(within: np.ndarray, elsewhere: np.ndarray, fewest: int, share: float) -> bool:
    if len(within) < fewest or len(elsewhere) < _FEWEST_PAIRS:
        return False
    return float(np.median(within)) > share * float(np.median(elsewhere))


def _missed_turn(track: Track, begin: float, end: float) -> float:
    """Return by how much [rad] all headings after a stretch may be wrong that go on from the one that stood.

    It is as much as the vehicle turns elsewhere in as long a time, in the root of the mean square.
    """
    if end >= track.times[-1]:
        return 0.0
    ends = track.times + end - begin
    starts = track.times[(ends <= begin) | ((track.times >= end) & (ends <= track.times[-1]))]
    turns = wrapped((track.at(starts + end - begin) - track.at(starts))[:, 2])
    return float(np.sqrt((turns**2).mean())) if len(turns) else _ANY_TURN


def _cause(begin: float, end: float, within: np.ndarray, elsewhere: np.ndarray, turn: float) -> Cause:
    nats = 0.0
    if len(within):
        noise = max(float(elsewhere.std()) / np.sqrt(len(within)), 1e-2)
        nats = 0.5 * (float(within.mean() - elsewhere.mean()) / noise) ** 2
    text = f"odometry frozen for {end - begin:.0f} s{' while the echoes move' if _moves(within, elsewhere) else ''},"
    return Cause(text, _CERTAIN + nats, begin, turn=turn, metres=_SPEED * (end - begin))


def _pairs(scans: Sequence[Scan]) -> Tuple[np.ndarray, np.ndarray]:
    """Return times (p, 2) [s], when the scans of each pair began and ended, and how far (p,) [m] they lie apart."""
    heard = [scan for scan in scans if len(scan) >= FEWEST]
    numbers, apart = near_pairs([scan.points[:: -(-len(scan) // MOST), :2] for scan in heard])
    times = [[heard[one].start, heard[other].reference_time] for one, other in numbers]
    return np.array(times).reshape(-1, 2), apart
