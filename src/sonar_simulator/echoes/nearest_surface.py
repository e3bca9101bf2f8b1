"""Finds the nearest surface inside each beam exactly; boxes of groups of triangles keep the search short."""

from typing import Iterator, Tuple

import numpy as np

from sonar_simulator.world.world import World

_GROUP = 8  # Triangles behind one box: fewer make more boxes to test, more make each of them looser
# m; margin of the boxes, which are compared in float32.
_BOX_MARGIN = 1e-3


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
    return ((low + high) / 2.0).astype(np.float32), ((high - low) / 2.0 + _BOX_MARGIN).astype(np.float32)


def _neighbours_first(centres: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return an order in which neighbouring triangles of one size class follow each other."""
    size_class = np.ceil(np.log2(np.maximum(sizes, _BOX_MARGIN)))
    extent = np.maximum(np.ptp(centres, axis=0), _BOX_MARGIN) if len(centres) else np.ones(3)
    cells = np.clip((centres / extent + 0.5) * 1023.0, 0, 1023).astype(np.int64)
    code = np.zeros(len(centres), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.lexsort((code, size_class))


# m; a segment that only rounding cuts to nothing still counts.
_TOLERANCE = 1e-9
# m; triangles whose planes are at most this far beyond the limit still count.
_MARGIN = 1e-3
# Only those sides of a cone are used that cut a triangle; their number is rounded up to one of these.
_CUTTING = (3, 5, 8, 12)
_NEXT_CORNER = np.array([1, 2, 0])


class NearestSurface:
    """Finds the nearest point of a world's triangles inside beams that are convex pyramids."""

    def __init__(self, world: World) -> None:
        corners = world.vertices[world.faces]
        self._faces = np.flatnonzero(world.normals.any(axis=1))
        self._corners = corners[self._faces]
        self._groups = TriangleGroups(self._corners)

    def find(
        self, origins: np.ndarray, rotations: np.ndarray, planes: np.ndarray, limits: np.ndarray
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return the (n, 3) nearest points inside beams, in the beams' frames, and their (n,) faces, -1 if none.

        origins: (n, 3) where the beams start, world frame, m. rotations: (n, 3, 3) R_world_beam.
        planes: (k, 3) inward unit normals of the beam's sides, beam frame. limits: (n,) m, greatest range.
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
    """Drop triangles with all corners behind one of the planes, and those whose plane is too far away."""
    ahead = ~(triangles @ planes.T < 0.0).all(axis=1).any(axis=1)
    beam, face, triangles = beam[ahead], face[ahead], triangles[ahead]
    kept = _reach_of_planes(triangles, _widest_cosine(planes)) <= limits[beam] + _MARGIN
    return beam[kept], face[kept], triangles[kept]


def _reach_of_planes(triangles: np.ndarray, cosine: float) -> np.ndarray:
    """Return the least distance in a round cone to the planes of triangles (p, 3, 3); `cosine`: of half its angle."""
    normals, heights = _planes_of(triangles)
    forward = np.clip(normals[:, 0] * np.sign(heights), -1.0, 1.0)
    # The cosine of the angle between the plane's perpendicular and the cone: 1 if the perpendicular is inside the cone.
    nearest = forward * cosine + np.sqrt((1.0 - forward**2) * (1.0 - cosine**2))
    nearest = np.where(forward >= cosine, 1.0, nearest)
    return np.where(nearest > 0.0, np.abs(heights) / np.maximum(nearest, _TOLERANCE), np.inf)


def _planes_of(triangles: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the unit normals (p, 3) of triangles (p, 3, 3), and how far their planes lie along these (p,)."""
    normals = _cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.sqrt(_dot(normals, normals))[:, np.newaxis]
    return normals, _dot(triangles[:, 0], normals)


def _widest_cosine(planes: np.ndarray) -> float:
    """Return the cosine of the angle between the beam's axis and its outermost edge; -1 if it has none."""
    first, second = np.triu_indices(len(planes), 1)
    edges = _cross(planes[first], planes[second])
    lengths = np.sqrt(_dot(edges, edges))
    edges = edges[lengths > _TOLERANCE] / lengths[lengths > _TOLERANCE, np.newaxis]
    edges = np.concatenate([edges, -edges])
    edges = edges[(edges @ planes.T >= -_TOLERANCE).all(axis=1)]
    return float(edges[:, 0].min()) if len(edges) else -1.0


def _cutting_planes(triangles: np.ndarray, planes: np.ndarray) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
    """Yield pair numbers (q,) and planes (q, j, 3), among them all that cut the triangles; few sides of a cone do."""
    depths = (triangles @ planes.T).min(axis=1)
    cut_by = (depths < 0.0).sum(axis=1)
    fewer = -1
    for most in (*(count for count in _CUTTING if count < len(planes)), len(planes)):
        pairs = np.flatnonzero((cut_by > fewer) & (cut_by <= most))
        if most == len(planes):
            yield pairs, np.broadcast_to(planes, (len(pairs), *planes.shape))
        else:
            yield pairs, planes[np.argpartition(depths[pairs], most - 1, axis=1)[:, :most]]
        fewer = most


def _nearest_points(triangles: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return the (p, 3) points nearest to the origin of triangles (p, 3, 3) inside their planes (p, k, 3), inf if none.

    The part of a triangle inside the beam is a convex polygon. Its nearest point is the foot of the perpendicular, or
    is on a side: on an edge of the triangle or on one of the planes.
    """
    normals, heights = _planes_of(triangles)
    edges = triangles[:, _NEXT_CORNER] - triangles
    edge_normals = _cross(normals[:, np.newaxis], edges)
    edge_normals /= np.sqrt(_dot(edge_normals, edge_normals))[..., np.newaxis]
    sides = np.concatenate([edge_normals, planes], axis=1)
    offsets = np.concatenate([_dot(edge_normals, triangles), np.zeros(planes.shape[:2])], axis=1)
    feet = heights[:, np.newaxis] * normals
    within = (_dot(sides, feet[:, np.newaxis]) >= offsets - _TOLERANCE).all(axis=1)
    points = np.where(within[:, np.newaxis], feet, np.inf)
    rest = np.flatnonzero(~within)
    along = edges[rest, 0] / np.sqrt(_dot(edges[rest, 0], edges[rest, 0]))[:, np.newaxis]
    # Unit vectors that span the planes of the triangles.
    axes = np.stack([along, _cross(normals[rest], along)], axis=1)
    points[rest] = _nearest_on_sides(axes, feet[rest], sides[rest], offsets[rest])
    return points


def _nearest_on_sides(axes: np.ndarray, feet: np.ndarray, sides: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return the (p, 3) point nearest to the foot on the sides of each polygon, inf if nothing is left of the polygon.

    The point of a convex polygon nearest to a point outside is always on a side that the outside point is beyond.
    """
    # In the triangle's plane, a half-space becomes a half-plane, described by its unit normal and its offset.
    flat = sides @ axes.transpose(0, 2, 1)
    lengths = np.sqrt(_dot(flat, flat))
    # A plane parallel to the triangle, with the triangle on its inner side, cuts nothing.
    cutting = lengths > _TOLERANCE
    flat /= np.where(cutting, lengths, np.inf)[..., np.newaxis]
    outside = offsets - _dot(sides, feet[:, np.newaxis])
    beyond = np.where(cutting, outside / np.where(cutting, lengths, 1.0), -np.inf)
    row, side = np.nonzero(beyond > 0.0)
    normals, away = flat[row, side], beyond[row, side]
    along = np.stack([-normals[:, 1], normals[:, 0]], axis=-1)
    low, high = _cut(flat[row], beyond[row], away[:, np.newaxis] * normals, along)
    steps = np.clip(0.0, low, np.maximum(low, high))
    squares = np.full(beyond.shape, np.inf)
    squares[row, side] = np.where(low <= high + _TOLERANCE, away**2 + steps**2, np.inf)
    nearest = np.flatnonzero(squares[row, side] == squares.min(axis=1)[row])
    nearest = nearest[np.isfinite(squares[row, side][nearest])]
    chosen = away[nearest, np.newaxis] * normals[nearest] + steps[nearest, np.newaxis] * along[nearest]
    points = np.full(feet.shape, np.inf)
    points[row[nearest]] = feet[row[nearest]] + np.einsum("li,lij->lj", chosen, axes[row[nearest]])
    return points


def _cut(flat: np.ndarray, beyond: np.ndarray, starts: np.ndarray, along: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return between which positions (l,), low and high, lines are inside half-planes; low > high: nowhere.

    The lines begin at `starts` (l, 2) and run `along` (l, 2); the half-planes have normals `flat` (l, s, 2) and
    offsets `beyond` (l, s).
    """
    slopes = _dot(flat, along[:, np.newaxis])
    missing = beyond - _dot(flat, starts[:, np.newaxis])
    rising, falling = slopes > _TOLERANCE, slopes < -_TOLERANCE
    level = ~(rising | falling)
    cuts = missing / np.where(level, 1.0, slopes)
    low = np.where(rising, cuts, -np.inf).max(axis=1)
    high = np.where(falling, cuts, np.inf).min(axis=1)
    return np.where((level & (missing > _TOLERANCE)).any(axis=1), np.inf, low), high


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product; numpy's own function takes several times as long for small batches."""
    a, b = np.broadcast_arrays(a, b)
    axes = ((1, 2), (2, 0), (0, 1))
    return np.stack([a[..., i] * b[..., j] - a[..., j] * b[..., i] for i, j in axes], axis=-1)
