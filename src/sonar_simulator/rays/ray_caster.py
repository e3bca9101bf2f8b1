"""Casts rays into a world."""

from functools import cached_property
from typing import Tuple

import numpy as np

from sonar_simulator.rays.nearest_surface import NearestSurface
from sonar_simulator.world.errors import MissingPackageError
from sonar_simulator.world.world import World

# Embree returns 1e37 where a ray hits nothing.
_NOTHING = 1e30


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
        """Finds the nearest surface inside a beam."""
        return NearestSurface(self.world)

    def distances(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return (n,) float64 distances, m, inf where nothing is hit. Both sides of a surface are solid.

        origins: (n, 3) in the world frame, m. directions: (n, 3) unit vectors in the world frame.
        """
        return self.hits(origins, directions)[0]

    def hits(self, origins: np.ndarray, directions: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return distances as `distances` does, and the (n,) faces of the world that are hit, -1 where none is."""
        found = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            query="INTERSECT",
            output=True,
        )
        distances = found["tfar"].astype(np.float64)
        distances[distances > _NOTHING] = np.inf
        return distances, found["primID"]
