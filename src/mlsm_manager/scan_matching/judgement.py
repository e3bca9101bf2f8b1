"""Whether scan and map are of one place.

Clutter, and a scan of another place, always find some of a map to lie on, but leave much of themselves beside it, and
hear echoes from behind surfaces that the map has in between.
"""

from typing import NamedTuple, Tuple

import numpy as np
from scipy.spatial import cKDTree

_DIRECTIONS = 128  # about a beam's width each
_REACH_QUANTILE = 0.9  # the farthest tenth of the echoes is chance: what lies beyond the others need not be heard
_BEYOND = 2.0  # m beyond the farthest echo that the map counts as known
# m, and rad as seen from the sonar (a beam's width): an echo nearer to a block than both is of that block.
_NEAR_DISTANCE, _NEAR_ANGLE = 1.0, 0.04


class Agreement(NamedTuple):
    """How far a scan lies on a map. explained: share of all echoes that lie on it. agreed: see `agreement`."""

    explained: float
    agreed: float


def agreement(points: np.ndarray, on_map: np.ndarray, position: np.ndarray, blocks: np.ndarray) -> Agreement:
    """Return how far a scan lies on a map; agreed: share of echoes that the map explains times that of blocks heard.

    points: (n, 2) m in map, n > 0, and which of them lie `on_map` (n,) bool. position: (2,) of the sonar. blocks:
    (m, 2) m in map, m > 0; those farther than nine tenths of the points are not expected to be heard.

    Three things say nothing: an echo in a direction in which the map has nothing yet, as on the way into unknown water;
    a surface behind a nearer echo, which may be hidden; and one in a direction without any echo, which may lie too flat
    to the sound.
    """
    direction, ranges = _polar(points - position)
    block_direction, block_range = _polar(blocks - position)
    known = block_direction[block_range < ranges.max() + _BEYOND]
    comparable = on_map | _beside(np.bincount(known, minlength=_DIRECTIONS) > 0, np.logical_or)[direction]
    nearest = np.full(_DIRECTIONS, np.inf)
    np.minimum.at(nearest, direction, ranges)
    first = _beside(nearest, np.minimum)[block_direction]
    tolerance = np.maximum(_NEAR_DISTANCE, _NEAR_ANGLE * block_range)
    distances, _ = cKDTree(points).query(blocks)
    inside = block_range < np.quantile(ranges, _REACH_QUANTILE)
    heard = inside & (distances < tolerance)
    denied = inside & ~heard & (block_range < first - tolerance) & np.isfinite(first)
    return Agreement(float(on_map.mean()), _share(on_map, comparable) * _share(heard, heard | denied))


def _share(of: np.ndarray, among: np.ndarray) -> float:
    """Return which share of those `among` (n,) is `of` (n,) too; 1 without any."""
    return float(of[among].mean()) if among.any() else 1.0


def _beside(values: np.ndarray, merged: np.ufunc) -> np.ndarray:
    """Return the values of directions merged with those of the directions to either side."""
    return merged(values, merged(np.roll(values, 1), np.roll(values, -1)))


def _polar(offsets: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the number (n,) of the direction and the distance (n,) of offsets (n, 2)."""
    x, y = np.array(offsets.T, order="C")
    turns = np.arctan2(y, x) / (2.0 * np.pi) + 0.5
    return (turns * _DIRECTIONS).astype(np.int64) % _DIRECTIONS, np.hypot(x, y)
