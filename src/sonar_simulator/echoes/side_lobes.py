"""A fan with side lobes all around, which faintly hear what is outside the beam."""

import math
from dataclasses import dataclass

import numpy as np

from sonar_simulator.rays.beam_pattern import BeamPattern


@dataclass(frozen=True)
class FanWithSideLobes:
    """The rays of `fan`, followed by `side_rays` more over all bearings at the fan's elevations.

    Only the fan bounds the beam: what only side lobes hear is not part of it.
    """

    fan: BeamPattern
    side_rays: int

    @property
    def rays(self) -> int:
        """Number of rays in one beam."""
        return self.fan.rays + self.side_rays

    @property
    def rays_inside(self) -> int:
        """Number of rays, from the first, that are between the planes."""
        return self.fan.rays

    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam, drawn anew for each beam."""
        jitter = rng.random((2, beams, self.side_rays))
        bearing = 2.0 * math.pi * (np.arange(self.side_rays) + jitter[0]) / max(1, self.side_rays)
        elevation = (jitter[1] - 0.5) * self.fan.vertical_opening
        level = np.cos(elevation)
        side = np.stack([level * np.cos(bearing), level * np.sin(bearing), np.sin(elevation)], axis=-1)
        return np.concatenate([self.fan.sample(beams, rng), side], axis=1)

    def shares(self) -> np.ndarray:
        """Return (rays,) the share of the fan's solid angle that each ray represents."""
        turns = 2.0 * math.pi / self.fan.horizontal_opening
        return np.concatenate([self.fan.shares(), np.full(self.side_rays, turns / max(1, self.side_rays))])

    def planes(self) -> np.ndarray:
        """Return (4, 3) inward normals of the fan's sides."""
        return self.fan.planes()
