"""Casts rays into a world, and follows them off mirrors."""

from dataclasses import dataclass
from functools import cached_property
from typing import Iterator, Tuple

import numpy as np

from sonar_simulator.echoes.nearest_surface import NearestSurface
from sonar_simulator.world.world import MissingPackageError, World

# Embree returns 1e37 where a ray hits nothing.
_NOTHING = 1e30
# m; sound that leaves a mirror starts this far from it, because embree has the precision of float32.
_OFF_SURFACE = 1e-3
# A ray with less than this share of its intensity after a mirror is dropped.
_FAINT = 1e-6
_UP = np.array([0.0, 0.0, 1.0])


class RayCaster:
    """Finds the nearest surface along rays. Raises MissingPackageError when embreex is not installed."""

    def __init__(self, world: World) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise MissingPackageError("casts the simulator's rays", "embreex", error) from error
        # Robust mode: rays that hit an edge between two triangles must not pass through it.
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(self._scene, world.vertices.astype(np.float32), world.faces.astype(np.int32))
        self.world = world

    @cached_property
    def nearest(self) -> NearestSurface:
        return NearestSurface(self.world)

    def hits(self, origins: np.ndarray, directions: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return (n,) distances, m, inf where nothing is hit, and the (n,) faces of the world that are hit, else -1.

        Both sides of a surface are solid. origins: (n, 3) in the world frame, m. directions: (n, 3) unit vectors in it.
        """
        found = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32), np.ascontiguousarray(directions, dtype=np.float32),
            query="INTERSECT", output=True,
        )  # fmt: skip
        distances = found["tfar"].astype(np.float64)
        distances[distances > _NOTHING] = np.inf
        return distances, found["primID"]


@dataclass(frozen=True)
class Mirrors:
    """How often sound is followed off mirrors, and whether the water's surface, the plane z = 0, is a mirror.

    surface_loss: share of the intensity that is lost at the water's surface, 0 to 1.
    """

    bounces: int = 0
    surface: bool = False
    surface_loss: float = 0.2


@dataclass(frozen=True)
class Leg:
    """One straight part of the path of n rays; rays that ended earlier have range inf and face -1.

    ranges: (n,) m along all legs up to the surface that is hit, inf for none. faces: (n,) of the world, -1 for none.
    directions: (n, 3) in the world frame. left: (n,) share of the intensity left after the mirrors so far, two-way.
    """

    ranges: np.ndarray
    faces: np.ndarray
    directions: np.ndarray
    left: np.ndarray


def legs(
    caster: RayCaster, origins: np.ndarray, directions: np.ndarray, mirrors: Mirrors, max_range: float
) -> Iterator[Leg]:
    """Yield the legs of rays from (n, 3) origins along (n, 3) unit directions, world frame; the first is direct."""
    origins, directions = origins.copy(), directions.copy()
    world = caster.world
    kept = np.array([material.reflection**2 * material.mirror for material in world.materials])
    gone, left = np.zeros(len(origins)), np.ones(len(origins))
    for bounce in range(mirrors.bounces + 1):
        on_way = np.flatnonzero((left > _FAINT) & (gone < max_range))
        distances, faces, surface = _met(caster, origins[on_way], directions[on_way], mirrors)
        ranges, all_faces = np.full(len(gone), np.inf), np.full(len(gone), -1, dtype=np.int64)
        ranges[on_way] = gone[on_way] + np.where(surface, np.inf, distances)
        all_faces[on_way] = np.where(np.isfinite(ranges[on_way]), faces, -1)
        yield Leg(ranges, all_faces, directions.copy(), left.copy())
        if bounce == mirrors.bounces:
            return
        normals = np.where(surface[:, np.newaxis], _UP, world.normals[faces])
        reach = np.where(np.isfinite(distances), distances, 0.0)
        origins[on_way], directions[on_way] = _mirrored(origins[on_way], directions[on_way], reach, normals)
        share = np.where(surface, 1.0 - mirrors.surface_loss, kept[world.face_material[faces]])
        left[on_way] *= np.where(np.isfinite(distances), share**2, 0.0)
        gone[on_way] += reach


def _met(
    caster: RayCaster, origins: np.ndarray, directions: np.ndarray, mirrors: Mirrors
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return distances, faces, and which rays hit the water's surface first."""
    distances, faces = caster.hits(origins, directions)
    if not mirrors.surface:
        return distances, faces, np.zeros(len(origins), dtype=bool)
    rising = (directions[:, 2] > 0.0) & (origins[:, 2] < 0.0)
    to_surface = np.where(rising, -origins[:, 2] / np.where(rising, directions[:, 2], 1.0), np.inf)
    surface = to_surface < distances
    return np.where(surface, to_surface, distances), faces, surface


def _mirrored(
    origins: np.ndarray, directions: np.ndarray, distances: np.ndarray, normals: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    across = np.einsum("ij,ij->i", directions, normals)[:, np.newaxis]
    turned = directions - 2.0 * across * normals
    return origins + distances[:, np.newaxis] * directions - np.sign(across) * _OFF_SURFACE * normals, turned
