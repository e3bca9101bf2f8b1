"""Echoes in line with their neighbours: pieces of a wall, however far apart the beams met it."""

import itertools

import numpy as np

from sonar_processing.shapes.sightings import Sightings

# Echoes looked at on each side: a neighbouring beam may hold noise or another surface in front of the wall.
_NEIGHBOURS = 4
# Beams from an echo to the next one of its wall: one that heard nothing, or two where the head is slow, lie between.
_REACH = 2.5
# A wall goes on beyond two of its echoes by this share of their distance; farther out their noise would aim it.
_CONTINUED = 1.5
# Sine of the angle between beam and wall above which two echoes make a line. Flatter lines lead from a thing to
# something far behind it, so that two echoes are in line by chance; then _FLAT_SUPPORT echoes have to lie on it.
_SQUARE = 0.5
_FLATTEST = 0.05
_FLAT_SUPPORT = 4


def wall_echoes(seen: Sightings, thing: float, tolerance: float) -> np.ndarray:
    """Return (n,) bool: the echoes within `tolerance` [m] of a line through echoes of neighbouring beams.

    Those neighbours are farther away than `thing` [m], the width of the widest thing that is no wall. Neighbours are
    told by the beams' order: a turning vehicle sees the same wall twice in a scan, and the odometry's error puts it
    in two places, so that what lies beside an echo need not be its neighbour.
    """
    found = np.zeros(len(seen.points), dtype=bool)
    if len(found) < 3 or seen.step <= 0.0:
        return found
    neighbours = _neighbours(seen, thing)
    for one, other in itertools.combinations(range(len(neighbours)), 2):
        found |= _in_line(seen, neighbours, one, other, thing, tolerance)
    return found


def _neighbours(seen: Sightings, thing: float) -> np.ndarray:
    """Return (2 k, n, 2): of each echo the k nearest of earlier beams and the k nearest of later ones, NaN for none."""
    reach = (thing / np.maximum(seen.ranges, thing) / seen.step + _REACH)[:, np.newaxis]
    later = seen.beams[np.newaxis] - seen.beams[:, np.newaxis]
    apart = np.linalg.norm(seen.points[np.newaxis] - seen.points[:, np.newaxis], axis=2)
    near = (np.abs(later) <= reach) & (apart > thing)
    return np.concatenate(
        [_nearest(seen.points, np.where(near & side, apart, np.inf)) for side in (later < 0, later > 0)]
    )


def _nearest(points: np.ndarray, distances: np.ndarray) -> np.ndarray:
    count = min(_NEIGHBOURS, len(points))
    nearest = np.argpartition(distances, count - 1, axis=1)[:, :count]
    there = np.isfinite(np.take_along_axis(distances, nearest, axis=1))
    return np.where(there[..., np.newaxis], points[nearest], np.nan).transpose(1, 0, 2)


def _in_line(
    seen: Sightings, neighbours: np.ndarray, one: int, other: int, thing: float, tolerance: float
) -> np.ndarray:
    """Return (n,) bool: the echoes in line with two of their neighbours."""
    start, along = neighbours[one], neighbours[other] - neighbours[one]
    length = np.linalg.norm(along, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = along / length[:, np.newaxis]
        share = np.einsum("ij,ij->i", seen.points - start, along) / length
        is_between = (share > 0.0) & (share < 1.0)
        is_continued = (share > -_CONTINUED) & (share < 1.0 + _CONTINUED) & (length > thing)
        support = np.count_nonzero(_across(neighbours - start, along) <= tolerance, axis=0)
        sine = _across(seen.towards, along)
        square = is_between & (sine >= _SQUARE)
        flat = (is_between | is_continued) & (sine >= _FLATTEST) & (support >= _FLAT_SUPPORT)
        return (square | flat) & (_across(seen.points - start, along) <= tolerance)


def _across(offsets: np.ndarray, along: np.ndarray) -> np.ndarray:
    return np.abs(offsets[..., 0] * along[..., 1] - offsets[..., 1] * along[..., 0])
