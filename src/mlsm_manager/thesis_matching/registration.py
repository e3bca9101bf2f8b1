"""The thesis's registration (6.5.6): the closest block along the movement, and the motion that takes points to theirs.

While the vehicle is still the error of all points is that of one pose; while it moves the error grows along a line over
time, whose slope is the velocity that is missing (figures 6.6 to 6.8).
"""

from typing import List, NamedTuple, Optional, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.surface_map.blocks import Blocks
from node_support.geometry import rotated

_MEDIANS = 3.0  # of normal errors across a wall 4 % are farther
_FEWEST_TIMES = 3  # two times always lie on a line, and show no error of it


class ClosestBlocks:
    """Finds blocks through the tree of their cells; `blocks` must hold at least one."""

    def __init__(self, blocks: Blocks) -> None:
        self._blocks = blocks
        cells, self._cell_of_block = np.unique(blocks.cells, axis=0, return_inverse=True)
        self._tree = cKDTree((cells + 0.5) * blocks.resolution)
        self._members = _padded_members(self._cell_of_block.reshape(-1), len(cells))

    def find(self, points: np.ndarray) -> np.ndarray:
        """Return (...) indices of the blocks closest to points (..., 3): of the nearest cell, the nearest in height."""
        _, cell = self._tree.query(points[..., :2])
        members = self._members[cell]
        z = points[..., 2, np.newaxis]
        gap = np.maximum(self._blocks.bottom[members] - z, z - self._blocks.height[members])
        gap = np.where(members >= 0, np.maximum(gap, 0.0), np.inf)
        best = gap.argmin(axis=-1)
        return np.take_along_axis(members, best[..., np.newaxis], axis=-1)[..., 0]

    def find_along(self, points: np.ndarray, steps: np.ndarray, samples: int) -> np.ndarray:
        """Return (n,) indices for points (n, 3) that moved (figure 6.5).

        Of the blocks closest to the point and to `samples` places one step (n, 3) apart from there on, it is the one
        that lies best in the direction of the step. Points whose step is zero take their closest block.
        """
        closest = self.find(points)
        length = np.linalg.norm(steps, axis=1)
        moved = length > 0.0
        if samples == 0 or not moved.any():
            return closest
        start, step = points[moved], steps[moved]
        places = start[:, np.newaxis, :] + np.arange(samples)[:, np.newaxis] * step[:, np.newaxis, :]
        found = self.find(places)
        direction = self._blocks.mean[found, :3] - start[:, np.newaxis, :]
        distance = np.maximum(np.linalg.norm(direction, axis=-1), 1e-12)
        cosine = np.einsum("nja,na->nj", direction, step / length[moved][:, np.newaxis]) / distance
        closest[moved] = found[np.arange(len(found)), cosine.argmax(axis=1)]
        return closest


def belonging(places: np.ndarray, targets: np.ndarray, resolution: float) -> np.ndarray:
    """Return (n,) bool: which places (n, 2) and targets (n, 2) [m] are pairs, and no echo that the map does not have.

    The thesis pairs every point (6.5.6). Its noise echoes then pull still scans up to 0.2 m along walls, even from the
    true pose; so only pairs count that are within three medians (as by Zhang 1994), or within one cell, as points and
    their blocks are when a map is drawn (6.5.6).
    """
    distance = np.linalg.norm(targets - places, axis=1)
    return distance <= max(resolution, _MEDIANS * float(np.median(distance)))


def rigid_motion(points: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return the motion (3,) x y yaw that takes points (n, 2) nearest to their targets (n, 2) (Besl and McKay 1992)."""
    middle, target = points.mean(axis=0), targets.mean(axis=0)
    arms, wanted = points - middle, targets - target
    cross = arms[:, 0] @ wanted[:, 1] - arms[:, 1] @ wanted[:, 0]
    yaw = np.arctan2(cross, (arms * wanted).sum())
    return np.append(target - rotated(middle, yaw), yaw)


class SegmentFit(NamedTuple):
    """translations: (n, 2) m for each point, in the order of time. slope: (2,) m/s of the last segment, 0 if still."""

    translations: np.ndarray
    slope: np.ndarray


def translate_segments(times: np.ndarray, moving: np.ndarray, errors: np.ndarray, counted: np.ndarray) -> SegmentFit:
    """Return the translations that segments of points need.

    times: (n,) s, increasing or equal. moving: (n,) bool; a segment is a run of equal values. errors: (n, 2) m from
    each point to its block. counted: (n,) bool, whose errors count; a segment without any goes on as the one before.
    A still segment moves by its mean error (the centroids' difference); a moving one starts with the translation that
    the segment before it ended with and goes on along a line.
    """
    translations = np.zeros((len(times), 2))
    slope = np.zeros(2)
    last: Optional[np.ndarray] = None
    for first, end in _runs(moving):
        part, chosen = slice(first, end), counted[first:end]
        if not chosen.any():
            translations[part] = 0.0 if last is None else last
        elif not moving[first]:
            slope = np.zeros(2)
            translations[part] = errors[part][chosen].mean(axis=0)
        else:
            since = times[part] - (times[first - 1] if first else times[first])
            offset, slope = _line(since[chosen], errors[part][chosen], last)
            translations[part] = offset + since[:, np.newaxis] * slope
        last = translations[end - 1]
    return SegmentFit(translations, slope)


def _runs(moving: np.ndarray) -> List[Tuple[int, int]]:
    """Return the first index and the end of each run of equal values."""
    changes = np.flatnonzero(np.diff(moving.astype(np.int8))) + 1
    bounds = np.concatenate([[0], changes, [len(moving)]])
    return list(zip(bounds[:-1], bounds[1:]))


def _line(since: np.ndarray, errors: np.ndarray, start: Optional[np.ndarray]) -> Tuple[np.ndarray, np.ndarray]:
    """Return offset (2,) and slope (2,) by least squares; the line begins at `start` (2,) where that is known."""
    if np.unique(since).size < _FEWEST_TIMES:
        return errors.mean(axis=0), np.zeros(2)
    if start is not None:
        return start, since @ (errors - start) / (since @ since)
    centered = since - since.mean()
    slope = centered @ errors / (centered @ centered)
    return errors.mean(axis=0) - since.mean() * slope, slope


def _padded_members(cell_of_block: np.ndarray, cells: int) -> np.ndarray:
    """Return (cells, k) block indices, -1 where a cell has fewer than k."""
    order = np.argsort(cell_of_block, kind="stable")
    sizes = np.bincount(cell_of_block, minlength=cells)
    rank = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    members = np.full((cells, int(sizes.max())), -1, dtype=np.int64)
    members[cell_of_block[order], rank] = order
    return members
