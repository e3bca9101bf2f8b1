"""The exact nearest surface inside beams.

Rays sample a beam: between them they miss the near edge of a floor by metres and a rope altogether. The echo of a beam
begins at the nearest point of all surfaces inside its pyramid, and that point follows from geometry alone: it is
visible, for whatever hid it would be nearer and in the beam too.
"""

from typing import Iterator, Tuple

import numpy as np

from sonar_simulator.triangle_groups import TriangleGroups
from sonar_simulator.world import World

# A segment cut to nothing by rounding alone still counts: m.
_TOLERANCE = 1e-9
# Planes of triangles that are no farther than this beyond the limit still count: m.
_MARGIN = 1e-3
# So many sides of a cone at most are looked at where no more cut a triangle.
_FEW = 5
_NEXT_CORNER = np.array([1, 2, 0])


class NearestSurface:
    """Finds the nearest point of a world's triangles inside beams that are convex pyramids."""

    def __init__(self, world: World) -> None:
        corners = world.vertices[world.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._faces = np.flatnonzero(np.einsum("ij,ij->i", normals, normals) > 0.0)
        self._corners = corners[self._faces]
        self._groups = TriangleGroups(self._corners)

    def find(
        self, origins: np.ndarray, rotations: np.ndarray, planes: np.ndarray, limits: np.ndarray
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return the (n, 3) nearest points inside beams, in the beams' frames, and their (n,) faces, -1 if none.

        origins: (n, 3) where the beams start, world frame, m. rotations: (n, 3, 3) R_world_beam.
        planes: (k, 3) inward unit normals of the beam's sides, beam frame. limits: (n,) m, look no farther.
        """
        sides = planes[:: max(1, len(planes) // 4)]
        beam, face = self._groups.reached(origins, np.einsum("nij,kj->kni", rotations, sides), limits)
        triangles = (self._corners[face] - origins[beam, np.newaxis]) @ rotations[beam]
        beam, face, triangles = _inside(beam, face, triangles, planes, limits)
        points = np.empty((len(beam), 3))
        for pairs, cutting in _cutting_planes(triangles, planes):
            points[pairs] = _nearest_points(triangles[pairs], cutting)
        squares = np.einsum("ij,ij->i", points, points)
        order = np.lexsort((squares, beam))
        order = order[np.isfinite(squares[order])]
        chosen, first = np.unique(beam[order], return_index=True)
        result = np.full((len(origins), 3), np.inf)
        faces = np.full(len(origins), -1, dtype=np.int64)
        result[chosen] = points[order[first]]
        faces[chosen] = self._faces[face[order[first]]]
        return result, faces


def _inside(
    beam: np.ndarray, face: np.ndarray, triangles: np.ndarray, planes: np.ndarray, limits: np.ndarray
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Leave out triangles that lie behind one of the planes with all corners, or in a plane too far away."""
    behind = (triangles @ planes.T < 0.0).all(axis=1).any(axis=1)
    normals = _cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    heights = np.abs(_dot(triangles[:, 0], normals)) / np.sqrt(_dot(normals, normals))
    kept = ~behind & (heights <= limits[beam] + _MARGIN)
    return beam[kept], face[kept], triangles[kept]


def _cutting_planes(triangles: np.ndarray, planes: np.ndarray) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
    """Yield pair numbers (q,) and planes (q, j, 3) that hold all that cut these triangles: of a cone's sides few do."""
    if len(planes) <= _FEW:
        yield np.arange(len(triangles)), np.broadcast_to(planes, (len(triangles), *planes.shape))
        return
    depths = (triangles @ planes.T).min(axis=1)
    cut_by_few = (depths < 0.0).sum(axis=1) <= _FEW
    few, many = np.flatnonzero(cut_by_few), np.flatnonzero(~cut_by_few)
    yield few, planes[np.argpartition(depths[few], _FEW - 1, axis=1)[:, :_FEW]]
    yield many, np.broadcast_to(planes, (len(many), *planes.shape))


def _nearest_points(triangles: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return the (p, 3) points of triangles (p, 3, 3) inside their planes (p, k, 3) nearest to the origin, inf if none.

    The part of a triangle inside the beam is a convex polygon. Its nearest point is the foot of the perpendicular, or
    lies on a side: on an edge of the triangle or on one of the planes.
    """
    normals = _cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.sqrt(_dot(normals, normals))[:, np.newaxis]
    heights = _dot(triangles[:, 0], normals)
    edges = triangles[:, _NEXT_CORNER] - triangles
    edge_normals = _cross(normals[:, np.newaxis], edges)
    edge_normals /= np.sqrt(_dot(edge_normals, edge_normals))[..., np.newaxis]
    sides = np.concatenate([edge_normals, planes], axis=1)
    offsets = np.concatenate([_dot(edge_normals, triangles), np.zeros(planes.shape[:2])], axis=1)
    feet = heights[:, np.newaxis] * normals
    within = (_dot(sides, feet[:, np.newaxis]) >= offsets - _TOLERANCE).all(axis=1)
    points = np.where(within[:, np.newaxis], feet, np.inf)
    rest = np.flatnonzero(~within)
    points[rest] = _nearest_on_sides(normals[rest], feet[rest], sides[rest], offsets[rest])
    return points


def _nearest_on_sides(normals: np.ndarray, feet: np.ndarray, sides: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return the (p, 3) point nearest to the foot on the sides of each polygon, inf if nothing of it is left."""
    # In the triangle's own plane a half-space is a half-plane: its normal there, made a unit vector, and its offset.
    flat = sides - _dot(sides, normals[:, np.newaxis])[..., np.newaxis] * normals[:, np.newaxis]
    lengths = np.sqrt(_dot(flat, flat))
    # A plane parallel to the triangle, which lies before it, cuts nothing.
    cutting = lengths > _TOLERANCE
    lengths = np.where(cutting, lengths, 1.0)
    flat = np.where(cutting[..., np.newaxis], flat, 0.0) / lengths[..., np.newaxis]
    beyond = np.where(cutting, (offsets - _dot(sides, feet[:, np.newaxis])) / lengths, -np.inf)
    along = _cross(normals[:, np.newaxis], flat)
    low, high = _cut(beyond, flat, along)
    steps = np.clip(0.0, low, np.maximum(low, high))
    squares = np.where(cutting & (low <= high + _TOLERANCE), beyond**2 + steps**2, np.inf)
    best = squares.argmin(axis=1)
    row = np.arange(len(offsets))
    found = np.isfinite(squares[row, best])
    row, best = row[found], best[found]
    points = np.full(feet.shape, np.inf)
    points[found] = feet[found] + beyond[row, best, np.newaxis] * flat[row, best]
    points[found] += steps[row, best, np.newaxis] * along[row, best]
    return points


def _cut(beyond: np.ndarray, flat: np.ndarray, along: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return from where to where, (p, s) each, the sides' lines run inside all half-planes; low > high: nowhere."""
    count = beyond.shape[1]
    slopes = along @ flat.transpose(0, 2, 1)
    on_line = np.where(np.isfinite(beyond), beyond, 0.0)[..., np.newaxis]
    starts = beyond[:, np.newaxis] - on_line * (flat @ flat.transpose(0, 2, 1))
    parallel = np.abs(slopes) <= _TOLERANCE
    cuts = starts / np.where(parallel, 1.0, slopes)
    low = np.where(~parallel & (slopes > 0.0), cuts, -np.inf).max(axis=2)
    high = np.where(~parallel & (slopes < 0.0), cuts, np.inf).min(axis=2)
    parallel[:, np.arange(count), np.arange(count)] = False
    return np.where((parallel & (starts > _TOLERANCE)).any(axis=2), np.inf, low), high


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product; numpy's own takes several times as long for small batches."""
    a, b = np.broadcast_arrays(a, b)
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )
