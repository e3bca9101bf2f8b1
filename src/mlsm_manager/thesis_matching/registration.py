"""The thesis's registration (6.5.6): the closest block along the movement, and translations by segments."""

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.surface_map.blocks import Blocks


class ClosestBlocks:
    """Finds blocks by cell; `blocks` must hold at least one."""

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
        """Return (n,) indices for points (n, 3) that moved: of the blocks closest to the point and to `samples` places
        one step (n, 3) apart from there on, the one that lies best in the direction of the step.

        Points whose step is zero take their closest block.
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
        best = cosine.argmax(axis=1)
        closest[moved] = found[np.arange(len(found)), best]
        return closest


def _padded_members(cell_of_block: np.ndarray, cells: int) -> np.ndarray:
    """Return (cells, k) block indices, -1 where a cell has fewer than k."""
    order = np.argsort(cell_of_block, kind="stable")
    sizes = np.bincount(cell_of_block, minlength=cells)
    rank = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    members = np.full((cells, int(sizes.max())), -1, dtype=np.int64)
    members[cell_of_block[order], rank] = order
    return members


# Two times always lie on a line, and show no error of it.
_FEWEST_TIMES = 3


@dataclass(frozen=True)
class SegmentFit:
    """translations: (n, 2) m for each point, in the order of time. slope: (2,) m/s of the last segment, 0 if still."""

    translations: np.ndarray
    slope: np.ndarray


def translate_segments(times: np.ndarray, moving: np.ndarray, errors: np.ndarray) -> SegmentFit:
    """Return the translations that segments of points need.

    times: (n,) s, increasing or equal. moving: (n,) bool; a segment is a run of equal values. errors: (n, 2) m from
    each point to its block. A still segment moves by its mean error (the centroids' difference); a moving one starts
    with the translation that the segment before it ended with and goes on along a line.
    """
    translations = np.zeros((len(times), 2))
    slope = np.zeros(2)
    last = np.zeros(2)
    for number, (first, end) in enumerate(_runs(moving)):
        part = slice(first, end)
        if not moving[first]:
            slope = np.zeros(2)
            translations[part] = errors[part].mean(axis=0)
        else:
            since = times[part] - (times[first - 1] if first else times[first])
            offset, slope = _line(since, errors[part], last if number else None)
            translations[part] = offset + since[:, np.newaxis] * slope
        last = translations[end - 1]
    return SegmentFit(translations, slope)


def _runs(moving: np.ndarray) -> List[Tuple[int, int]]:
    changes = np.flatnonzero(np.diff(moving.astype(np.int8))) + 1
    bounds = np.concatenate([[0], changes, [len(moving)]])
    return [(int(first), int(end)) for first, end in zip(bounds[:-1], bounds[1:]) if end > first]


def _line(since: np.ndarray, errors: np.ndarray, start: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return offset (2,) and slope (2,) by least squares; the line begins at `start` where that is known."""
    if np.unique(since).size < _FEWEST_TIMES:
        return errors.mean(axis=0), np.zeros(2)
    if start is not None:
        return start, since @ (errors - start) / (since @ since)
    centered = since - since.mean()
    slope = centered @ errors / (centered @ centered)
    return errors.mean(axis=0) - since.mean() * slope, slope
