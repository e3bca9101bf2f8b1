"""Smooths a whole run after it is over: keyframes, edges, a pose graph, and the map made anew."""

from dataclasses import dataclass
from typing import Callable, List

import numpy as np

from mlsm_manager.matching.matchers.matcher_table import Matcher
from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.matching.problem.scan import Track
from mlsm_manager.matching.problem.state import MOTION
from mlsm_manager.offline.keyframes import Keyframe, keyframes_of, path_through
from mlsm_manager.offline.loops import ScanMatching, scan_edges
from mlsm_manager.offline.pose_graph import RelativePoses, UnaryFactors, joined, smoothed
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import Replayed
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry.planar import composed, inverse, transformed

_HEADING_LASTS = 300.0


@dataclass(frozen=True)
class Refined:
    """poses: (m, 3) T_map_base at the recording's odometry times. blocks: of the map made anew.

    edges: how many matches of keyframes with others were used.
    """

    poses: np.ndarray
    blocks: Blocks
    edges: int


def refine(recording: Recording, replayed: Replayed, matcher: Matcher, on_match: Callable[[int], None]) -> Refined:
    """Return the run smoothed over all its scans; the causal run is the seed. `matcher` compares some scans."""
    mapper = replayed.mapper
    keyframes = keyframes_of(replayed.updates)
    if len(keyframes) < 2:
        return Refined(replayed.corrected, mapper.shown.blocks, 0)
    poses = np.array([keyframe.pose for keyframe in keyframes])
    motion = replayed.updates[-1].belief.theta[MOTION]
    matching = ScanMatching(matcher, mapper.errors, mapper.settings.match_resolution, motion)
    edges = scan_edges(keyframes, poses, matching, on_match)
    times = np.array([keyframe.time for keyframe in keyframes])
    by_odometry = odometry_edges(times, recording.track, mapper.errors)
    unary = _unary_factors(times, recording.track, mapper.errors)
    found = smoothed(poses, joined([by_odometry, edges]), unary)
    path = path_through(found.poses, times, found.motion, recording.track)
    blocks = rebuilt(keyframes, Track(recording.track.times, path), mapper.settings.resolution)
    return Refined(path, blocks, len(edges))


def odometry_edges(times: np.ndarray, track: Track, errors: OdometryErrors) -> RelativePoses:
    """Return the edges of the odometry between keyframes at `times` (k,) s; errors that do not last are its noise."""
    known = track.at(times)
    seconds = np.diff(times)
    lasting = 2.0 * np.minimum(errors.rate_time, seconds) * seconds
    information = np.zeros((len(seconds), 3, 3))
    information[:, 0, 0] = information[:, 1, 1] = 1.0 / (errors.speed_deviation**2 * lasting + 1e-6)
    information[:, 2, 2] = 1.0 / (errors.turn_rate_deviation**2 * lasting + 1e-10)
    first = np.arange(len(seconds))
    relative = composed(inverse(known[:-1]), known[1:])
    return RelativePoses(first, first + 1, relative, information, np.ones(len(seconds), dtype=bool))


def _unary_factors(times: np.ndarray, track: Track, errors: OdometryErrors) -> UnaryFactors:
    information = 0.0
    if errors.heading_deviation > 0.0:
        # Neighbouring keyframes share the compass's error: together they say no more than one of them.
        together = max(_HEADING_LASTS / max(float(np.median(np.diff(times))), 1e-3), 1.0)
        information = 1.0 / (errors.heading_deviation**2 * together)
    motion = np.maximum([errors.scale_deviation, errors.direction_deviation], 1e-6) ** -2.0
    return UnaryFactors(track.at(times)[:, 2], information, motion)


def rebuilt(keyframes: List[Keyframe], path: Track, resolution: float) -> Blocks:
    """Return the map of all keyframes' points, each placed by the `path` T_map_base at its own time."""
    surfaces = MultiLevelSurfaceMap(resolution)
    for keyframe in keyframes:
        scan = keyframe.scan
        correction = composed(path.at(scan.times), inverse(scan.track.at(scan.times)))
        surfaces.insert(transformed(correction, scan.points))
    return surfaces.blocks
