"""How far the clock of the beams is from that of the vehicle's motion: where echoes of turns one after the other meet.

Placed by the motion of the right time, the walls of one turn lie on those of the next, above all while the vehicle
turns.
"""

from contextlib import suppress
from typing import List, NamedTuple, Tuple

import numpy as np
from scipy.spatial import cKDTree

from node_support.errors import RefusedInput
from node_support.geometry import bearings_of, rotation_matrices
from recordings.bags.bag import RecordingError
from recordings.motion.pose_track import PoseTrack
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters
from sonar_processing.scans.assembler import RevolutionCollector
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan

_FARTHEST = 600.0  # s: clocks that were set by hand or by a network differ by less
_STEP = 1.0  # s: the vehicle turns by less than a beam is wide
_FINE_STEP = 0.1
_CELL = 2.0  # m: echoes within it meet, in the first search
_NEAR = 1.0  # m: standard deviation of a meeting, in the second
_FEWEST_TURNS = 8
_COVERED = 0.3  # share of the echoes at least, at an offset that counts
_CLEAR = 6.0  # deviations of all offsets by which the best one is better than the usual; noise reaches 4 in 1,200
_NORMAL = 1.48  # standard deviation over the median of absolute differences
_PARTS = 4  # of the recording, whose own offsets tell the deviation


class _Echoes(NamedTuple):
    """points: (n, 2) m in the vehicle's frame. times: (n,) s by the beams' clock. turn: (n,) number, increasing."""

    points: np.ndarray
    times: np.ndarray
    turn: np.ndarray


class _Way(NamedTuple):
    """times: (m,) s. poses: (m, 3) x y [m] and yaw [rad], without jumps by a turn."""

    times: np.ndarray
    poses: np.ndarray

    def placed(self, echoes: _Echoes, offset: float) -> np.ndarray:
        """Return where echoes (n, 2) lie if `offset` [s] is added to their times, NaN where no pose is known."""
        times = echoes.times + offset
        x, y, yaw = (np.interp(times, self.times, axis) for axis in self.poses.T)
        cosine, sine = np.cos(yaw), np.sin(yaw)
        forward, left = echoes.points.T
        found = np.column_stack([x + cosine * forward - sine * left, y + sine * forward + cosine * left])
        found[(times < self.times[0]) | (times > self.times[-1])] = np.nan
        return found


def clock_offset(beams: List[Beam], track: PoseTrack, T_base_sonar: np.ndarray) -> Tuple[float, float]:
    """Return what must be added to the stamps of `beams`, s, so that `track`, T_odom_base, has the same clock, and the
    deviation of that, s.

    Looked for are offsets of up to ten minutes, and where the two have no time in common those around all that let
    one lie in the other. Raises RecordingError where the echoes do not tell.
    """
    echoes, turns = _echoes(beams, T_base_sonar), rotation_matrices(track.rotations)
    yaws = np.unwrap(bearings_of(turns[..., 0]))
    way = _Way(track.stamps_ns * 1e-9, np.column_stack([track.translations[:, :2], yaws]))
    offsets = _candidates(echoes, way)
    scores = np.array([_meeting(way.placed(echoes, offset), echoes.turn) for offset in offsets])
    clearness = _clearness(scores)
    best = float(offsets[int(np.nanargmax(scores))])
    if clearness < _CLEAR:
        raise RecordingError(
            f"the echoes do not tell the offset of the clocks: the best, {best:.0f} s, is only {clearness:.1f} "
            f"deviations above others, {_CLEAR:g} are needed; give --offset SECONDS"
        )
    seconds = _finest(echoes, way, best)
    return seconds, _deviation(echoes, way, seconds)


def _clearness(scores: np.ndarray) -> float:
    """Return by how many deviations the best score is better than the usual one. Raises RecordingError for too few."""
    known = scores[np.isfinite(scores)]
    if len(known) < 2:
        raise RecordingError("the clocks of beams and motion have too little time in common; give --offset SECONDS")
    usual = np.median(known)
    return float((known.max() - usual) / (_NORMAL * np.median(np.abs(known - usual)) + np.finfo(float).tiny))


def _deviation(echoes: _Echoes, way: _Way, seconds: float) -> float:
    """Return the standard deviation of an offset, s, from those of parts of the recording."""
    bounds = np.quantile(echoes.turn, np.linspace(0.0, 1.0, _PARTS + 1))
    parts = [
        _Echoes(*(values[(echoes.turn >= low) & (echoes.turn <= high)] for values in echoes))
        for low, high in zip(bounds, bounds[1:])
    ]
    own = np.array([_finest(part, way, seconds) for part in parts])
    return max(float(np.sqrt(np.mean((own - seconds) ** 2) / _PARTS)), _FINE_STEP / 2.0)


def _echoes(beams: List[Beam], T_base_sonar: np.ndarray) -> _Echoes:
    """Return the echoes of all whole turns. Raises RecordingError for too few."""
    extractor, collector = EchoExtractor(EchoExtractorParameters()), RevolutionCollector()
    points, times = [], []
    for beam in sorted(beams, key=lambda one: one.stamp_ns):
        turn = collector.add(PlacedBeam(beam, T_base_sonar, is_moving=True))
        if turn is not None:
            with suppress(RefusedInput):
                found = extractor(PolarScan.of(turn).cloud(SonarToCloudParameters()))
                points.append(found.points[:, :2])
                times.append(np.abs(found.time_stamps))
    if len(points) < _FEWEST_TURNS:
        raise RecordingError(
            f"{len(points)} turns or sweeps do not tell the offset of the clocks, {_FEWEST_TURNS} are needed; "
            "give --offset SECONDS"
        )
    turn = np.repeat(np.arange(len(points)), [len(one) for one in points])
    return _Echoes(np.concatenate(points), np.concatenate(times), turn)


def _candidates(echoes: _Echoes, way: _Way) -> np.ndarray:
    first, last = way.times[0] - echoes.times[0], way.times[-1] - echoes.times[-1]
    if way.times[0] < echoes.times[-1] and way.times[-1] > echoes.times[0]:
        first = last = 0.0
    return np.arange(min(first, last) - _FARTHEST, max(first, last) + _FARTHEST + _STEP, _STEP)


def _meeting(placed: np.ndarray, turn: np.ndarray) -> float:
    """Return the share of echoes in a cell with one of the turn before; NaN where too few are placed."""
    known = np.isfinite(placed[:, 0])
    if known.mean() < _COVERED:
        return np.nan
    cells = np.floor(placed[known] / _CELL).astype(np.int64) % 2**20
    keys = (cells[:, 0] << 20) + cells[:, 1]
    own = turn[known].astype(np.int64) << 40
    return float(np.isin(keys + own, keys + own + (1 << 40)).mean())


def _finest(echoes: _Echoes, way: _Way, around: float) -> float:
    """Return the best offset within two steps of `around`, s."""
    offsets = around + np.arange(-2.0 * _STEP, 2.0 * _STEP + _FINE_STEP / 2.0, _FINE_STEP)
    scores = [_nearness(way.placed(echoes, offset), echoes.turn) for offset in offsets]
    # A parabola through the top is finer than the steps, and does not follow single echoes.
    best = int(np.argmax(scores))
    near = slice(max(best - 5, 0), best + 6)
    curve = np.polyfit(offsets[near] - around, scores[near], 2)
    if curve[0] >= 0.0:
        return float(offsets[best])
    return around + float(np.clip(-curve[1] / (2.0 * curve[0]), -2.0 * _STEP, 2.0 * _STEP))


def _nearness(placed: np.ndarray, turn: np.ndarray) -> float:
    """Return how near the echoes of each turn lie to those of the turn before, 1 for echoes that meet."""
    known = np.isfinite(placed[:, 0])
    bounds = np.flatnonzero(np.diff(turn[known])) + 1
    turns = np.split(placed[known], bounds)
    sums = [np.exp(-0.5 * (cKDTree(before).query(own)[0] / _NEAR) ** 2).sum() for before, own in zip(turns, turns[1:])]
    return float(sum(sums)) / max(len(placed), 1)
