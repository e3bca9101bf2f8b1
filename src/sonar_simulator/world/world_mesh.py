"""The world as coloured triangles, for a marker or a picture."""

from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np

from sonar_simulator.world.world import Shape, World

# m; extent shown of infinite planes if there is nothing else.
_SHOWN = 100.0


@dataclass(frozen=True)
class WorldTriangles:
    """Corners, three per triangle: points (3 m, 3) in the world frame, m, colours (3 m, 4) RGBA from 0 to 1."""

    points: np.ndarray
    colours: np.ndarray


def world_triangles(world: World) -> WorldTriangles:
    """Return all triangles of a world; infinite planes are cut to the extent of the rest."""
    bounded = [shape for shape in world.shapes if np.isfinite(shape.size).all()]
    low, high = _extent(bounded)
    points, colours = [np.empty((0, 3))], [np.empty((0, 4), dtype=np.float32)]
    for shape in world.shapes:
        vertices, faces = (shape if np.isfinite(shape.size).all() else _cut(shape, low, high)).triangles()
        points.append(vertices[faces].reshape(-1, 3))
        colour = shape.material.colour if shape.colour is None else shape.colour
        colours.append(np.tile(np.array(colour, dtype=np.float32), (3 * len(faces), 1)))
    return WorldTriangles(np.concatenate(points), np.concatenate(colours))


def _extent(shapes: list) -> Tuple[np.ndarray, np.ndarray]:
    if not shapes:
        return np.full(3, -_SHOWN / 2.0), np.full(3, _SHOWN / 2.0)
    vertices = np.concatenate([shape.triangles()[0] for shape in shapes])
    return vertices.min(axis=0), vertices.max(axis=0)


def _cut(plane: Shape, low: np.ndarray, high: np.ndarray) -> Shape:
    """Return the part of an infinite plane below, above and beside a box from `low` to `high` m in the world."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
    flat = (corners - plane.pose[:3, 3]) @ plane.pose[:3, :2]
    pose = plane.pose.copy()
    pose[:3, 3] += plane.pose[:3, :2] @ ((flat.min(axis=0) + flat.max(axis=0)) / 2.0)
    width, length = np.maximum(np.ptp(flat, axis=0), 1e-3)
    return replace(plane, pose=pose, size=(float(width), float(length)))
