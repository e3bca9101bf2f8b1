"""Which triangles may reach into a beam: bounding spheres of triangles, in groups that lie close together."""

from typing import Tuple

import numpy as np

_GROUP = 16
# Spheres are compared in float32.
_MARGIN = 1e-3


class TriangleGroups:
    """Bounding spheres of triangles (m, 3, 3), m."""

    def __init__(self, corners: np.ndarray) -> None:
        low, high = corners.min(axis=1), corners.max(axis=1)
        centres = (low + high) / 2.0
        radii = np.linalg.norm(corners - centres[:, np.newaxis], axis=2).max(axis=1, initial=0.0)
        self._middle = centres.mean(axis=0) if len(centres) else np.zeros(3)
        centres = centres - self._middle
        order = _neighbours_first(centres, radii)
        padded = np.append(order, np.full(-len(order) % _GROUP, -1))
        self._members = padded.reshape(-1, _GROUP)
        missing = self._members < 0
        self._centres = centres[self._members].astype(np.float32)
        self._radii = np.where(missing, -np.inf, radii[self._members] + _MARGIN).astype(np.float32)
        self._group_centres, self._group_radii = _enclosing(self._centres, self._radii)
        self._squares = np.einsum("ij,ij->i", self._group_centres, self._group_centres)

    def reached(self, origins: np.ndarray, planes: np.ndarray, limits: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return (beam, triangle) pairs whose sphere reaches into the beam.

        origins: (n, 3) m. planes: (k, n, 3) inward unit normals of each beam's sides. limits: (n,) m, no farther.
        """
        origins, planes = (origins - self._middle).astype(np.float32), planes.astype(np.float32)
        limits = np.minimum(limits, 1e15).astype(np.float32)
        offsets = np.einsum("knj,nj->kn", planes, origins)
        beam, group = np.nonzero(self._groups_reached(origins, planes, offsets, limits))
        centres, radii = self._centres[group], self._radii[group]
        away = centres - origins[beam, np.newaxis]
        near = np.einsum("pij,pij->pi", away, away) <= np.square(limits[beam, np.newaxis] + np.maximum(radii, 0.0))
        near &= radii > 0.0
        for normals in planes:
            near &= np.einsum("pij,pj->pi", away, normals[beam]) >= -radii
        pair, member = np.nonzero(near)
        return beam[pair], self._members[group[pair], member]

    def _groups_reached(
        self, origins: np.ndarray, planes: np.ndarray, offsets: np.ndarray, limits: np.ndarray
    ) -> np.ndarray:
        reach = np.square(limits[:, np.newaxis] + self._group_radii) * (1.0 + _MARGIN) + _MARGIN
        squares = np.einsum("ij,ij->i", origins, origins)[:, np.newaxis] + self._squares
        near = squares - 2.0 * (origins @ self._group_centres.T) <= reach
        for normals, offset in zip(planes, offsets):
            near &= normals @ self._group_centres.T >= offset[:, np.newaxis] - self._group_radii
        return near


def _neighbours_first(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return an order in which triangles of one size class that lie close together follow each other."""
    size = np.ceil(np.log2(np.maximum(radii, _MARGIN)))
    extent = np.maximum(np.ptp(centres, axis=0), _MARGIN) if len(centres) else np.ones(3)
    cells = np.clip(((centres / extent + 0.5) * 1023.0), 0, 1023).astype(np.int64)
    code = np.zeros(len(centres), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.lexsort((code, size))


def _enclosing(centres: np.ndarray, radii: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return centres (g, 3) and radii (g,) of spheres around groups (g, k, 3) of spheres; a radius of -inf is none."""
    there = np.isfinite(radii)[..., np.newaxis]
    low = np.where(there, centres - radii[..., np.newaxis], np.inf).min(axis=1)
    high = np.where(there, centres + radii[..., np.newaxis], -np.inf).max(axis=1)
    middles = (low + high) / 2.0
    outer = np.linalg.norm(centres - middles[:, np.newaxis], axis=2) + radii
    return middles, outer.max(axis=1) + np.float32(_MARGIN)
