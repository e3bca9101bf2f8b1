"""The round beam of the collision model."""

import math
from dataclasses import dataclass

import numpy as np

# Gazebo's unit_cone, the shape of the thesis's sensor, is also a pyramid with many sides.
_SIDES = 16


@dataclass(frozen=True)
class ConePattern:
    """Rays spread evenly over a cone of full angle `opening`, rad (thesis 6.4.1, 6.4.2).

    The cone is a pyramid with 16 sides, like a mesh of a cone; each flat side touches the round cone from outside.
    """

    opening: float
    rays: int

    @property
    def rays_inside(self) -> int:
        """Number of rays between the planes: all."""
        return self.rays

    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam: a sunflower, rotated anew for each beam."""
        number = np.arange(self.rays)
        turn = number * math.pi * (3.0 - math.sqrt(5.0)) + 2.0 * math.pi * rng.random((beams, 1))
        radius = math.tan(self.opening / 2.0) * np.sqrt((number + rng.random((beams, self.rays))) / self.rays)
        slopes = np.stack([np.ones_like(turn), radius * np.cos(turn), radius * np.sin(turn)], axis=-1)
        return slopes / np.sqrt(np.einsum("...i,...i", slopes, slopes))[..., np.newaxis]

    def shares(self) -> np.ndarray:
        """Return (rays,) equal shares."""
        return np.full(self.rays, 1.0 / self.rays)

    def planes(self) -> np.ndarray:
        """Return (16, 3) inward normals; four of them bound the cone below, above, right and left."""
        half = self.opening / 2.0
        turn = np.arange(_SIDES) * 2.0 * math.pi / _SIDES
        return np.column_stack(
            [np.full(_SIDES, math.sin(half)), -math.cos(half) * np.cos(turn), -math.cos(half) * np.sin(turn)]
        )
