"""Strong echoes that stand alone in their scan, as those of posts and buoys."""

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.measured.surface_points import SurfacePoints, points_per_echo, ramp, reaches, sights
from mlsm_manager.scan_matching.scan import Scan
from sonar_processing.filters.echo_extractor import height_threshold

_COUNTED = 6  # nearest points that are counted, the point included; more are no small thing
_ALONE = (3.4, 2.4)  # points within reach, the point included: from too many for something small to few enough
_NEAR = 0.75  # share of the reach within which a point counts fully; from there to the reach it fades out
_EXTENDED = 3.0  # times the reach: so far a wall may go on with single echoes
_BESIDE = (1.0, 2.0)  # m beside the line of a wall: from an echo of the wall to one of something else
_ASKEW = 0.1  # rad by which the line of a wall may be turned
_STRONG = 1.5  # times Otsu's threshold of a scan: from there on an echo that stands alone is no speckle
_MISTAKEN = (3.0, 12.0)  # m: from what is heard together in all scans to how far a vehicle goes in a turn of the head
_OTHERS = (1.0, 0.3)
"""Lone points within these distances of each, on average: from too many to few enough. With (1.5, 0.5) clutter in a
simulated canal was taken for posts in one of three runs; with these in none of six."""
_NOTHING = 1e-9  # m: keeps points on top of each other, or of the sonar, from dividing by zero


def lone_points(scan: Scan, sonar_in_base: np.ndarray, surfaces: SurfacePoints) -> SurfacePoints:
    """Return the strong points of a scan that too few others surround for a line; their normals are the lines of sight.

    sonar_in_base: (2,) m, where the sonar is in base_link. surfaces: the points of the scan that lie on surfaces. The
    last echoes of a wall, where the sonar's range ends, are none: they travel with the vehicle.
    """
    sight = sights(scan, sonar_in_base)
    ranges, bearings = np.hypot(*sight.T), np.arctan2(sight[:, 1], sight[:, 0])
    reach = reaches(scan.times, bearings, ranges)
    threshold = max(height_threshold(scan.points[:, 3]), _NOTHING)
    strong = ramp(scan.points[:, 3], threshold, _STRONG * threshold)
    qualities = ramp(crowds(scan.points[:, :2], reach), *_ALONE) * strong
    candidates = np.flatnonzero((qualities > 0.0) & (ranges > 0.0))
    qualities[candidates] *= 1.0 - on_surfaces(sight[candidates], reach[candidates], surfaces)
    qualities = qualities * _distinctness(sight, qualities)
    qualities = qualities / np.sqrt(points_per_echo(scan.times, ranges))
    normals = sight / np.maximum(ranges, _NOTHING)[:, np.newaxis]
    known = (qualities > 0.0) & (ranges > 0.0)
    arrays = (scan.times, ranges, bearings, normals, np.zeros(len(ranges)), qualities)
    return SurfacePoints(*(array[known] for array in arrays))


def _distinctness(places: np.ndarray, qualities: np.ndarray) -> float:
    """Return how much a scan's lone points count, 0 to 1: where many stand together, each may be taken for another.

    places: (n, 2) m. Clutter is dense, and in the fit some of it always meets other clutter.
    """
    lone = np.flatnonzero(qualities > 0.0)
    if not len(lone):
        return 1.0
    distance = np.hypot(*(places[lone, np.newaxis] - places[lone]).transpose(2, 0, 1))
    others = ((distance > _MISTAKEN[0]) & (distance < _MISTAKEN[1])) @ qualities[lone]
    return float(ramp(np.array([others @ qualities[lone] / qualities[lone].sum()]), *_OTHERS)[0])


def crowds(points: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return how many points (n,) there are within `reach` (n,) [m] of each of `points` (n, 2), itself included."""
    count = min(_COUNTED, len(points))
    if not count:
        return np.zeros(0)
    distance, _ = cKDTree(points).query(points, k=np.arange(1, count + 1))
    reach = np.maximum(reach, _NOTHING)[:, np.newaxis]
    return ramp(distance, reach, _NEAR * reach).sum(axis=1)


def on_surfaces(places: np.ndarray, reach: np.ndarray, surfaces: SurfacePoints) -> np.ndarray:
    """Return how much points at `places` (n, 2) [m] from the sonar lie where surfaces near them go on: (n,), 0 to 1.

    reach: (n,) m, within which neighbours on a surface are.
    """
    if not len(places) or not len(surfaces):
        return np.zeros(len(places))
    known = surfaces.ranges[:, np.newaxis] * np.column_stack([np.cos(surfaces.bearings), np.sin(surfaces.bearings)])
    offset = places[:, np.newaxis] - known
    distance = np.hypot(offset[..., 0], offset[..., 1])
    beside = np.abs(np.einsum("nsa,sa->ns", offset, surfaces.normals)) - _ASKEW * distance
    farthest = _EXTENDED * reach[:, np.newaxis]
    near = ramp(distance, farthest, _NEAR * farthest) * ramp(beside, _BESIDE[1], _BESIDE[0])
    return (near * np.minimum(1.0, surfaces.qualities)).max(axis=1)
