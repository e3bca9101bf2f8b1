"""Whether a fit can be trusted: it must beat chance and the places beside it, and scan and map must be of one place.

Clutter always finds something of a map to lie on, and two long walls match wherever the scan lies along them: what
decides then is a handful of points. A scan of another place finds some of the map to lie on, but leaves much of itself
beside it, and hears echoes from behind surfaces that the map has in between.
"""

from typing import Callable, Tuple

import numpy as np
from scipy.spatial import cKDTree

from node_support.geometry import bearings_of

_PLACES = 48  # with so many the standard deviation of their shares is known to a tenth
_SHIFT = 8.0  # m: beyond what a wall is thick, within what a scan sees
_LEAST_DEVIATION = 0.02  # of a share of 150 echoes: three of them
# m: nearer places are the same fit; farther ones than 10 m no beam of a scan confuses.
_LEAST_SHIFT, _GREATEST_SHIFT, _SHIFT_STEP = 1.5, 10.0, 0.5
_DIRECTIONS = 128  # about a beam's width each
_REACH_QUANTILE = 0.9  # the farthest tenth of the echoes is chance: what lies beyond the others need not be heard
_BEYOND = 2.0  # m beyond the farthest echo that the map counts as known
# m, and rad as seen from the sonar (a beam's width): an echo nearer to a block than both is of that block.
_NEAR_DISTANCE, _NEAR_ANGLE = 1.0, 0.04

OfMoves = Callable[[np.ndarray], np.ndarray]
"""From moves (k, 3) of a fit's pose, x y [m] yaw [rad], to a value (k,) of each."""


def significance(matched_shares: OfMoves) -> float:
    """Return by how many standard deviations the matched share of a fit beats that of other places.

    The other places lie up to 8 m away with any heading.
    """
    rng = np.random.default_rng(0)
    places = rng.uniform(-_SHIFT, _SHIFT, (_PLACES, 2))
    moves = np.column_stack([places, rng.uniform(-np.pi, np.pi, _PLACES)])
    shares = matched_shares(np.vstack([np.zeros(3), moves]))
    return float((shares[0] - shares[1:].mean()) / max(shares[1:].std(), _LEAST_DEVIATION))


def lead_along(gains: OfMoves, direction: np.ndarray, nearest: float) -> float:
    """Return by how much the gain of a fit beats that of the best place beside it; inf where none is beside.

    Those places lie `nearest`, but at least 1.5 m, to 10 m away, to both sides along `direction` (2,), a unit vector in
    map.
    """
    shifts = np.arange(_LEAST_SHIFT, _GREATEST_SHIFT + _SHIFT_STEP / 2.0, _SHIFT_STEP)
    shifts = shifts[shifts >= nearest]
    moves = np.outer(np.concatenate([[0.0], -shifts, shifts]), np.append(direction, 0.0))
    found = gains(moves)
    return float(found[0] - found[1:].max(initial=-np.inf))


def agreement(points: np.ndarray, on_map: np.ndarray, position: np.ndarray, blocks: np.ndarray) -> Tuple[float, float]:
    """Return the share of echoes that lie on a map; and how far scan and map agree: the share of echoes that the map
    explains times that of blocks heard.

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
    return float(on_map.mean()), _share(on_map, comparable) * _share(heard, heard | denied)


def _share(of: np.ndarray, among: np.ndarray) -> float:
    """Return which share of those `among` (n,) is `of` (n,) too; 1 without any."""
    return float(of[among].mean()) if among.any() else 1.0


def _beside(values: np.ndarray, merged: np.ufunc) -> np.ndarray:
    """Return the values of directions merged with those of the directions to either side."""
    return merged(values, merged(np.roll(values, 1), np.roll(values, -1)))


def _polar(offsets: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the number (n,) of the direction and the distance (n,) of offsets (n, 2)."""
    turns = bearings_of(offsets) / (2.0 * np.pi) + 0.5
    return (turns * _DIRECTIONS).astype(np.int64) % _DIRECTIONS, np.hypot(*offsets.T)
