"""Triangle meshes of boxes, cylinders, spheres and planes."""

from typing import Sequence, Tuple

import numpy as np

Mesh = Tuple[np.ndarray, np.ndarray]
# The chords of a 64-gon are at most 0.12 % of the radius inside the circle, less than a bin at any range.
_SEGMENTS = 64
_RINGS = 32  # Half of the segments, so that the facets of a sphere are as high as wide
_ENDLESS = 4000.0  # m: far beyond any sonar's range, and still exact to a millimetre in float32


def box(x: float, y: float, z: float) -> Mesh:
    """Return a box of the given edge lengths, m."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return signs * np.array([x, y, z]) / 2.0, _split(np.array(quads))


def cylinder(radius: float, length: float) -> Mesh:
    """Return a closed cylinder about the z axis, m."""
    half = length / 2.0
    return _revolved(np.array([0.0, radius, radius, 0.0]), np.array([-half, -half, half, half]))


def sphere(radius: float) -> Mesh:
    polar = np.linspace(0.0, np.pi, _RINGS + 1)
    return _revolved(radius * np.sin(polar), -radius * np.cos(polar))


def plane(x: float, y: float) -> Mesh:
    """Return a rectangle perpendicular to the z axis, m; an infinite one is cut off where no sonar hears it."""
    half_x, half_y = min(x, _ENDLESS) / 2.0, min(y, _ENDLESS) / 2.0
    corners = [[-half_x, -half_y, 0.0], [half_x, -half_y, 0.0], [half_x, half_y, 0.0], [-half_x, half_y, 0.0]]
    return np.array(corners), _split(np.array([[0, 1, 2, 3]]))


def _revolved(radii: np.ndarray, heights: np.ndarray) -> Mesh:
    """Rotate a profile about the z axis; triangles that degenerate to lines on the axis are left out."""
    turn = np.arange(_SEGMENTS) * 2.0 * np.pi / _SEGMENTS
    rings = [
        np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(_SEGMENTS, height)])
        for radius, height in zip(radii, heights)
    ]
    here = np.arange(_SEGMENTS)
    there = np.roll(here, -1)
    strip = np.column_stack([here, there, there + _SEGMENTS, here + _SEGMENTS])
    vertices = np.concatenate(rings)
    faces = _split(np.concatenate([strip + ring * _SEGMENTS for ring in range(len(radii) - 1)]))
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return vertices, faces[areas > 1e-9 * areas.max()]


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return one mesh of all meshes: the vertices (n, 3) and faces (m, 3), int32."""
    vertices, faces, count = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int32)], 0
    for corners, triangles in meshes:
        vertices.append(corners)
        faces.append(triangles + count)
        count += len(corners)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32)


def _split(quads: np.ndarray) -> np.ndarray:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)


MESHES = {"box": box, "cylinder": cylinder, "sphere": sphere, "plane": plane}
