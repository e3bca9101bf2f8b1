"""How far points are from the surfaces of a world."""

import numpy as np

from benchmarks.triangle_distance import triangle_distances
from sonar_simulator.world.world import Shape, World


def distances(world: World, points: np.ndarray) -> np.ndarray:
    """Return (n,) distances [m] of points (n, 3) from the nearest surface, which may be seen from inside or outside."""
    return np.min([_distance(shape, points) for shape in world.shapes], axis=0)


def nearest_shape(world: World, points: np.ndarray) -> np.ndarray:
    """Return (n,) indices into the world's shapes."""
    return np.argmin([_distance(shape, points) for shape in world.shapes], axis=0)


def _distance(shape: Shape, points: np.ndarray) -> np.ndarray:
    if shape.kind == "mesh":
        vertices, faces = shape.triangles()
        return triangle_distances(vertices[faces], points)
    local = (points - shape.pose[:3, 3]) @ shape.pose[:3, :3]
    if shape.kind == "sphere":
        return np.abs(np.linalg.norm(local, axis=1) - shape.size[0])
    if shape.kind == "cylinder":
        radius, length = shape.size
        beyond = np.column_stack([np.hypot(local[:, 0], local[:, 1]) - radius, np.abs(local[:, 2]) - length / 2.0])
    else:
        beyond = np.abs(local) - np.array(shape.size) / 2.0
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.where(beyond.max(axis=1) > 0.0, outside, -beyond.max(axis=1))
