"""The world around the sonar: shapes, their triangles, materials, and outlines from above."""

from dataclasses import dataclass
from functools import cached_property
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np
from scipy.spatial import ConvexHull

from sonar_simulator.world import primitives
from sonar_simulator.world.materials import DEFAULT_MATERIAL, Colour, Material

# A shape that is this many times wider than high, in both directions, is ground and gets no outline among the walls.
_GROUND_RATIO = 10.0


@dataclass(frozen=True)
class Shape:
    """A solid or a surface placed in the world.

    name: its path in the file, as model/link/collision.
    kind, size: "box" (x, y, z), "cylinder" (radius, length) about its z axis, "sphere" (radius,), "plane" (x, y)
        across its z axis, or "mesh" (scale along x, y and z); m.
    pose: (4, 4) T_world_shape; a primitive is centred on its own origin.
    material: of its surface.
    mesh: of a "mesh", its vertices (n, 3) in m before scaling and faces (m, 3).
    colour: for pictures, red, green, blue, alpha from 0 to 1; None: that of its material.
    """

    name: str
    kind: str
    pose: np.ndarray
    size: Tuple[float, ...]
    material: Material = DEFAULT_MATERIAL
    mesh: Optional[primitives.Mesh] = None
    colour: Optional[Colour] = None

    def triangles(self) -> primitives.Mesh:
        """Return vertices (n, 3) in the world frame, m, and faces (m, 3) as indices into them."""
        vertices, faces = primitives.MESHES[self.kind](*self.size) if self.mesh is None else self.mesh
        if self.mesh is not None:
            vertices = vertices * np.array(self.size)
        return vertices @ self.pose[:3, :3].T + self.pose[:3, 3], faces


@dataclass(frozen=True)
class World:
    """Everything that reflects sound: vertices (n, 3) float64 in m, faces (m, 3) int32, and the shapes they come from.

    face_material: (m,) index of each face's material into `materials`.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    shapes: Tuple[Shape, ...]
    face_material: np.ndarray
    materials: Tuple[Material, ...]

    @classmethod
    def from_shapes(cls, name: str, shapes: Sequence[Shape]) -> "World":
        """Join the triangles of all shapes into one mesh."""
        vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int32)]
        materials: Dict[Material, int] = {}
        face_material = [np.empty(0, dtype=np.intp)]
        count = 0
        for shape in shapes:
            corners, triangles = shape.triangles()
            vertices.append(corners)
            faces.append(triangles + count)
            face_material.append(np.full(len(triangles), materials.setdefault(shape.material, len(materials))))
            count += len(corners)
        return cls(
            name,
            np.concatenate(vertices),
            np.concatenate(faces).astype(np.int32),
            tuple(shapes),
            np.concatenate(face_material),
            tuple(materials),
        )

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (m, 3) of the faces; 0 where a face has no area."""
        corners = self.vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        return normals / np.where(lengths > 0.0, lengths, 1.0)

    def outlines(self) -> List[np.ndarray]:
        """Return the outlines from above of all shapes but ground: closed (k, 2) polylines, m, first point repeated."""
        corners = [shape.triangles()[0] for shape in self.shapes]
        return [_outline(vertices[:, :2]) for vertices in corners if not _is_ground(vertices)]


def _is_ground(vertices: np.ndarray) -> bool:
    width_x, width_y, height = np.ptp(vertices, axis=0)
    return min(width_x, width_y) > _GROUND_RATIO * height


def _outline(points: np.ndarray) -> np.ndarray:
    try:
        corners = ConvexHull(points).vertices
    except RuntimeError:
        # QhullError, which scipy 1.3 does not export: a flat vertical shape is a line when seen from above.
        ends = points[np.argsort(points @ np.ptp(points, axis=0))[[0, -1]]]
        return ends[[0, 1, 0]]
    return points[np.append(corners, corners[0])]
