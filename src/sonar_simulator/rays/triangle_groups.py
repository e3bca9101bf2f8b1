"""Finds triangles that may reach into a beam, by bounding boxes of triangles and of groups of neighbours."""

from typing import Tuple

import numpy as np

_GROUP = 8  # Triangles behind one box: fewer make more boxes to test, more make each of them looser
# m; margin of the boxes, which are compared in float32.
_MARGIN = 1e-3


class TriangleGroups:
    """Axis-aligned bounding boxes of triangles (m, 3, 3), m, and of groups of them."""

    def __init__(self, corners: np.ndarray) -> None:
        low, high = corners.min(axis=1), corners.max(axis=1)
        self._middle = (low + high).mean(axis=0) / 2.0 if len(corners) else np.zeros(3)
        low, high = low - self._middle, high - self._middle
        order = _neighbours_first((low + high) / 2.0, np.linalg.norm(high - low, axis=1))
        # An incomplete group repeats its last triangle; the repetitions are removed at the end.
        self._members = np.append(order, np.repeat(order[-1:], -len(order) % _GROUP)).reshape(-1, _GROUP)
        self._is_first = np.arange(self._members.size).reshape(self._members.shape) < len(order)
        self._boxes = _boxes(low[self._members], high[self._members])
        self._group_boxes = _boxes(low[self._members].min(axis=1), high[self._members].max(axis=1))

    def reached(self, origins: np.ndarray, planes: np.ndarray, limits: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the (beam, triangle) pairs for which the triangle's box reaches into the beam.

        origins: (n, 3) m. planes: (k, n, 3) inward unit normals of each beam's sides. limits: (n,) m, greatest range.
        """
        origins, planes = (origins - self._middle).astype(np.float32), planes.astype(np.float32)
        limits = np.minimum(limits, 1e15).astype(np.float32)
        beam, group = np.nonzero(self._groups_reached(origins, planes, limits))
        centres, halves = (boxes[group] for boxes in self._boxes)
        away = centres - origins[beam, np.newaxis]
        near = self._is_first[group]
        gaps = np.maximum(np.abs(away) - halves, 0.0)
        near &= np.einsum("pij,pij->pi", gaps, gaps) <= np.square(limits[beam, np.newaxis])
        for normals in planes[:, beam]:
            near &= np.einsum("pij,pj->pi", away, normals) + np.einsum("pij,pj->pi", halves, np.abs(normals)) >= 0.0
        pair, member = np.nonzero(near)
        return beam[pair], self._members[group[pair], member]

    def _groups_reached(self, origins: np.ndarray, planes: np.ndarray, limits: np.ndarray) -> np.ndarray:
        centres, halves = (boxes.T for boxes in self._group_boxes)
        squares = np.zeros((len(origins), centres.shape[1]), dtype=np.float32)
        for axis in range(3):
            gap = np.abs(centres[axis] - origins[:, axis, np.newaxis]) - halves[axis]
            squares += np.square(np.maximum(gap, 0.0))
        near = squares <= np.square(limits)[:, np.newaxis]
        for normals in planes:
            offsets = np.einsum("nj,nj->n", normals, origins)[:, np.newaxis]
            near &= normals @ centres + np.abs(normals) @ halves >= offsets
        return near


def _boxes(low: np.ndarray, high: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return centres and half edges of boxes, slightly enlarged."""
    return ((low + high) / 2.0).astype(np.float32), ((high - low) / 2.0 + _MARGIN).astype(np.float32)


def _neighbours_first(centres: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return an order in which neighbouring triangles of one size class follow each other."""
    size_class = np.ceil(np.log2(np.maximum(sizes, _MARGIN)))
    extent = np.maximum(np.ptp(centres, axis=0), _MARGIN) if len(centres) else np.ones(3)
    cells = np.clip((centres / extent + 0.5) * 1023.0, 0, 1023).astype(np.int64)
    code = np.zeros(len(centres), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.lexsort((code, size_class))
