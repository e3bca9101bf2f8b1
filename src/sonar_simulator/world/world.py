"""A world: shapes with materials as one mesh of triangles, and the errors of reading one."""

import sys
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np
from scipy.spatial import ConvexHull

from node_support.parameters import ParameterError
from sonar_simulator.world.primitives import MESHES, Mesh, joined


class WorldError(ParameterError):
    """A file cannot be loaded as a world; the text names the file."""


class MissingPackageError(WorldError):
    """A Python package that the simulator needs is not installed; the text says how to install it."""

    def __init__(self, purpose: str, package: str, reason: ImportError) -> None:
        """`purpose` says what the package does here; `package` is its name at PyPI."""
        super().__init__(f"{reason}: it {purpose}; install it: {sys.executable} -m pip install {package}")


FARTHEST = 1e6
"""m from the origin: no surface may be farther, for rays are cast with float32."""
Colour = Tuple[float, float, float, float]


@dataclass(frozen=True)
class Material:
    """The acoustic properties of a surface at high frequencies.

    reflection: share of the pressure reflected at normal incidence, 0 to 1, from the impedances of water and
        material: (Z - Zw) / (Z + Zw).
    slope: rms slope of the surface's facets (tangent); small is like a mirror, large scatters sound in all directions.
    lambert_db: strength of Lambert's diffuse scattering, dB (10 log mu, APL-UW TR 9407).
    mirror: share of the reflected intensity that is reflected as by a mirror, 0 to 1.
    colour: red, green, blue, alpha, 0 to 1, for pictures.
    """

    name: str
    reflection: float
    slope: float
    lambert_db: float
    mirror: float
    colour: Colour = (0.6, 0.6, 0.6, 1.0)


# Reflections from impedances in MRayl (water 1.5): concrete 8, steel 45, granite 13, quartz sand 3.5, mud 1.8, oak 3,
# PVC 3.3, glass fibre 4.5, rubber 1.8. Lambert's strengths of sediments and rock after APL-UW TR 9407.
_ALL = (
    Material("concrete", 0.68, 0.30, -12.0, 0.5, (0.62, 0.62, 0.60, 1.0)),
    Material("steel", 0.93, 0.15, -20.0, 0.8, (0.45, 0.50, 0.56, 1.0)),
    Material("rock", 0.79, 0.50, -10.0, 0, (0.45, 0.42, 0.38, 1.0)),
    Material("gravel", 0.50, 0.40, -17.0, 0, (0.55, 0.52, 0.45, 1.0)),
    Material("sand", 0.40, 0.25, -22.0, 0.1, (0.80, 0.72, 0.50, 1.0)),
    Material("mud", 0.10, 0.25, -27.0, 0.1, (0.40, 0.33, 0.25, 1.0)),
    Material("wood", 0.33, 0.30, -16.0, 0.3, (0.55, 0.38, 0.20, 1.0)),
    Material("plastic", 0.38, 0.15, -18.0, 0.8, (0.95, 0.55, 0.10, 1.0)),
    Material("fibreglass", 0.50, 0.15, -18.0, 0.8, (0.55, 0.70, 0.80, 1.0)),
    Material("rubber", 0.09, 0.20, -20.0, 0.5, (0.15, 0.15, 0.15, 1.0)),
)
MATERIALS: Dict[str, Material] = {material.name: material for material in _ALL}
DEFAULT_MATERIAL = MATERIALS["concrete"]


def material_of_reflection(reflection: float) -> Material:
    """Return a material that reflects this share of the pressure, 0 to 1, and is otherwise the default."""
    like = DEFAULT_MATERIAL
    return Material(f"reflection {reflection:g}", reflection, like.slope, like.lambert_db, like.mirror, like.colour)


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
    mesh: Optional[Mesh] = None
    colour: Optional[Colour] = None

    def triangles(self) -> Mesh:
        """Return vertices (n, 3) in the world frame, m, and faces (m, 3) as indices into them."""
        vertices, faces = MESHES[self.kind](*self.size) if self.mesh is None else self.mesh
        if self.mesh is not None:
            vertices = vertices * np.array(self.size)
        return vertices @ self.pose[:3, :3].T + self.pose[:3, 3], faces


@dataclass(frozen=True)
class World:
    """Everything that reflects sound: vertices (n, 3) float64 in m, faces (m, 3) int32, and the shapes they come from.

    face_material: (m,) index of each face's material into `materials`. warnings: one line for each part of the file
    that could not be loaded.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    shapes: Tuple[Shape, ...]
    face_material: np.ndarray
    materials: Tuple[Material, ...]
    warnings: Tuple[str, ...] = ()

    @classmethod
    def from_shapes(cls, name: str, shapes: Sequence[Shape], warnings: Sequence[str] = ()) -> "World":
        meshes = [shape.triangles() for shape in shapes]
        vertices, faces = joined(meshes)
        materials: Dict[Material, int] = {}
        numbers = [materials.setdefault(shape.material, len(materials)) for shape in shapes]
        face_material = np.repeat(np.array(numbers, dtype=np.intp), [len(triangles) for _, triangles in meshes])
        return cls(name, vertices, faces, tuple(shapes), face_material, tuple(materials), tuple(warnings))

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (m, 3) of the faces; 0 where a face has no area."""
        corners = self.vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        return normals / np.where(lengths > 0.0, lengths, 1.0)

    def outlines(self) -> List[np.ndarray]:
        """Return the outlines from above of all shapes but ground: closed (k, 2) polylines, m, first point repeated."""
        outlines = []
        for shape in self.shapes:
            vertices, _ = shape.triangles()
            width_x, width_y, height = np.ptp(vertices, axis=0)
            if min(width_x, width_y) <= _GROUND_RATIO * height:
                outlines.append(_outline(vertices[:, :2]))
        return outlines


def _outline(points: np.ndarray) -> np.ndarray:
    try:
        corners = ConvexHull(points).vertices
    except RuntimeError:
        # QhullError, which scipy 1.3 does not export: a flat vertical shape is a line when seen from above.
        ends = points[np.argsort(points @ np.ptp(points, axis=0))[[0, -1]]]
        return ends[[0, 1, 0]]
    return points[np.append(corners, corners[0])]


# m; extent shown of infinite planes if there is nothing else.
_SHOWN = 100.0


def world_triangles(world: World) -> Tuple[np.ndarray, np.ndarray]:
    """Return the corners (3 m, 3) [m] of all triangles of a world, three per triangle, and their colours (3 m, 4).

    Colours are RGBA from 0 to 1; infinite planes are cut to the extent of the rest.
    """
    bounded = [shape for shape in world.shapes if np.isfinite(shape.size).all()]
    low, high = _extent(bounded)
    points, colours = [np.empty((0, 3))], [np.empty((0, 4), dtype=np.float32)]
    for shape in world.shapes:
        vertices, faces = (shape if np.isfinite(shape.size).all() else _cut(shape, low, high)).triangles()
        points.append(vertices[faces].reshape(-1, 3))
        colour = shape.material.colour if shape.colour is None else shape.colour
        colours.append(np.tile(np.array(colour, dtype=np.float32), (3 * len(faces), 1)))
    return np.concatenate(points), np.concatenate(colours)


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
