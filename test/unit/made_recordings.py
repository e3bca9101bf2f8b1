"""A small recording: a vehicle tours an angular basin, without a simulator."""

from typing import Callable, Tuple

import numpy as np

from mlsm_manager.offline.recording import Recording
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import matrices
from sonar_processing.beams.beam import Beam, PlacedBeam

SECONDS = 300.0
_START = 1000.0
_CORNERS = np.array(
    [[-25.0, -18.0], [20.0, -18.0], [20.0, -6.0], [30.0, -6.0], [30.0, 20.0], [4.0, 20.0], [4.0, 14.0], [-25.0, 14.0]]
)  # m
_BINS, _RESOLUTION = 200, 0.3
_BEAM, _STEP = 0.1, np.radians(3.6)


def touring() -> Recording:
    """Return 300 s of a vehicle that goes ahead on an ellipse, with a beam and a pose each tenth."""
    return _along(lambda angle: (12.0 * np.cos(angle) - 2.0, 8.0 * np.sin(angle)))


def wandering() -> Recording:
    """Return as much of a vehicle on a way that does not repeat itself."""
    return _along(lambda angle: (12.0 * np.cos(0.9 * angle) - 2.0, 8.0 * np.sin(1.7 * angle + 0.1 * angle**2)))


def _along(way: Callable[[np.ndarray], Tuple[np.ndarray, np.ndarray]]) -> Recording:
    """Return a recording of a vehicle that is at way(angle), x and y [m], while the angle [rad] grows to 4 pi."""
    times = _START + np.arange(0.0, SECONDS + 0.05, 0.1)
    x, y = way(4.0 * np.pi * (times - _START) / SECONDS)
    yaw = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    track = Track(times, np.column_stack([x, y, yaw]))
    stamps = np.arange(_START + 1.0, _START + SECONDS - 1.0, _BEAM)
    poses, heads = track.at(stamps), _STEP * np.arange(len(stamps))
    ranges = _ranges(poses[:, :2], poses[:, 2] + heads)
    places = matrices(poses)
    beams = [
        PlacedBeam(Beam(round(1e9 * stamp), "sonar", head, _strengths(distance), _RESOLUTION), place, True)
        for stamp, head, distance, place in zip(stamps, heads, ranges, places)
    ]
    return Recording(beams, 0, track, None)


def _ranges(origins: np.ndarray, bearings: np.ndarray) -> np.ndarray:
    """Return the distances (n,) [m] of the walls from (n, 2) along bearings (n,) [rad]."""
    ahead = np.column_stack([np.cos(bearings), np.sin(bearings)])[:, np.newaxis]
    first, wall = _CORNERS - origins[:, np.newaxis], np.roll(_CORNERS, -1, axis=0) - _CORNERS
    crossed = ahead[..., 0] * wall[:, 1] - ahead[..., 1] * wall[:, 0]
    crossed = np.where(np.abs(crossed) < 1e-9, 1e-9, crossed)
    along = (first[..., 0] * wall[:, 1] - first[..., 1] * wall[:, 0]) / crossed
    share = (first[..., 0] * ahead[..., 1] - first[..., 1] * ahead[..., 0]) / crossed
    return np.where((along > 0.0) & (share >= 0.0) & (share <= 1.0), along, np.inf).min(axis=1)


def _strengths(distance: float) -> np.ndarray:
    """Return strengths (bins,) of an echo at a distance [m]."""
    strengths = np.zeros(_BINS, dtype=np.uint8)
    place = min(int(distance / _RESOLUTION), _BINS - 3)
    strengths[place : place + 3] = 100
    return strengths
