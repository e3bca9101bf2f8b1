"""Whether a scan and the map around it are of one place: what each has, the other must not deny.

A scan of another place finds some of the map to lie on, but leaves much of itself beside it, and hears echoes from
behind surfaces that the map has in between. Three things say nothing: an echo in a direction in which the map has
nothing yet, as on the way into unknown water; a surface behind a nearer echo, which may be hidden; and one in a
direction without any echo, which may lie too flat to the sound.
"""

from typing import Tuple

import numpy as np
from scipy.spatial import cKDTree

# About a beam's width each.
_DIRECTIONS = 128
# The farthest tenth of the echoes is chance: what lies beyond the others need not be heard.
_REACH_QUANTILE = 0.9
# m beyond the farthest echo that the map counts as known.
_BEYOND = 2.0
# m, and rad as seen from the sonar (a beam's width): an echo nearer to a block than both is of that block.
_NEAR_DISTANCE = 1.0
_NEAR_ANGLE = 0.04


def agreement(points: np.ndarray, on_map: np.ndarray, position: np.ndarray, blocks: np.ndarray) -> float:
    """Return the share of echoes that the map explains times the share of blocks that no echo denies, 0 to 1.

    points: (n, 2) m in map, n > 0, and which of them lie `on_map` (n,) bool. position: (2,) of the sonar. blocks:
    (m, 2) m in map, m > 0; those farther than nine tenths of the points are not expected to be heard.
    """
    direction, ranges = _polar(points - position)
    block_direction, block_range = _polar(blocks - position)
    known = block_direction[block_range < ranges.max() + _BEYOND]
    comparable = on_map | _beside(np.bincount(known, minlength=_DIRECTIONS) > 0, np.logical_or)[direction]
    explained = float(on_map[comparable].mean()) if comparable.any() else 1.0
    nearest = np.full(_DIRECTIONS, np.inf)
    np.minimum.at(nearest, direction, ranges)
    first = _beside(nearest, np.minimum)[block_direction]
    tolerance = np.maximum(_NEAR_DISTANCE, _NEAR_ANGLE * block_range)
    distances, _ = cKDTree(points).query(blocks)
    inside = block_range < np.quantile(ranges, _REACH_QUANTILE)
    heard = inside & (distances < tolerance)
    denied = inside & ~heard & (block_range < first - tolerance) & np.isfinite(first)
    reached = np.count_nonzero(heard | denied)
    return explained * (np.count_nonzero(heard) / reached if reached else 1.0)


def _beside(values: np.ndarray, merged: np.ufunc) -> np.ndarray:
    """Return the values of directions merged with those of the directions to either side."""
    return merged(values, merged(np.roll(values, 1), np.roll(values, -1)))


def _polar(offsets: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the number (n,) of the direction and the distance (n,) of offsets (n, 2)."""
    x, y = np.array(offsets.T, order="C")
    turns = np.arctan2(y, x) / (2.0 * np.pi) + 0.5
    return (turns * _DIRECTIONS).astype(np.int64) % _DIRECTIONS, np.hypot(x, y)
