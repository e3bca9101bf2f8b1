"""The world the sonar looks at: primitive shapes, their triangles and their outlines from above."""

from dataclasses import dataclass
from typing import List, Sequence, Tuple

import numpy as np
from scipy.spatial import ConvexHull

from sonar_simulator import primitives

# A shape this many times wider than high, both ways, is ground: it has no outline to draw among walls.
_GROUND_RATIO = 10.0


@dataclass(frozen=True)
class Shape:
    """A convex solid placed in the world.

    name: where it stands in its file, as model/link/collision.
    kind, size: "box" (x, y, z), "cylinder" (radius, length) about its z axis or "sphere" (radius,); m.
    pose: (4, 4) T_world_shape; the shape is centred on its own origin.
    """

    name: str
    kind: str
    pose: np.ndarray
    size: Tuple[float, ...]

    def triangles(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return vertices (n, 3) in the world frame, m, and faces (m, 3) as indices into them."""
        vertices, faces = primitives.MESHES[self.kind](*self.size)
        return vertices @ self.pose[:3, :3].T + self.pose[:3, 3], faces


@dataclass(frozen=True)
class World:
    """All that reflects sound: vertices (n, 3) float64 in m, faces (m, 3) int32, the shapes they are of."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    shapes: Tuple[Shape, ...]

    @classmethod
    def from_shapes(cls, name: str, shapes: Sequence[Shape]) -> "World":
        """Join the triangles of all shapes into one mesh."""
        vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int32)]
        count = 0
        for shape in shapes:
            corners, triangles = shape.triangles()
            vertices.append(corners)
            faces.append(triangles + count)
            count += len(corners)
        return cls(name, np.concatenate(vertices), np.concatenate(faces).astype(np.int32), tuple(shapes))

    def outlines(self) -> List[np.ndarray]:
        """Return shapes but ground as seen from above: closed (k, 2) polylines, m, first point repeated."""
        corners = [shape.triangles()[0] for shape in self.shapes]
        return [_outline(vertices[:, :2]) for vertices in corners if not _is_ground(vertices)]


def _is_ground(vertices: np.ndarray) -> bool:
    width_x, width_y, height = np.ptp(vertices, axis=0)
    return min(width_x, width_y) > _GROUND_RATIO * height


def _outline(points: np.ndarray) -> np.ndarray:
    corners = ConvexHull(points).vertices
    return points[np.append(corners, corners[0])]
