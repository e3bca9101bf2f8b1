"""The rays of a beam: a fan, a fan with side lobes, and a round cone."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

# Gazebo's unit_cone, the shape of the thesis's sensor, is also a pyramid with many sides.
_SIDES = 16


class RayPattern(ABC):
    """Rays inside a beam that is a convex pyramid; the beam's frame has x along its axis and z up.

    rays: their number in one beam.
    """

    rays: int

    @property
    def rays_inside(self) -> int:
        """Number of rays, from the first, that are between the planes."""
        return self.rays

    @abstractmethod
    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam, drawn anew for each beam."""

    @abstractmethod
    def planes(self) -> np.ndarray:
        """Return (k, 3) unit normals, inward, of the planes through the sonar that bound the beam."""

    def shares(self) -> np.ndarray:
        """Return (rays,) the share of the beam's solid angle that each ray represents."""
        return np.full(self.rays, 1.0 / self.rays)


@dataclass(frozen=True)
class BeamPattern(RayPattern):
    """A fan: a pyramid of rows x columns rays, one in each stratum of equal angles (thesis 4.1.1, 6.4.3).

    vertical_opening, horizontal_opening: full angles of the beam, rad, below pi.
    """

    vertical_opening: float
    horizontal_opening: float
    rows: int
    columns: int

    @property
    def rays(self) -> int:
        """Number of rays in one beam."""
        return self.rows * self.columns

    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam.

        Every beam gets its own jitter: rays at fixed elevations would draw the floor as concentric arcs.
        """
        jitter = rng.random((2, beams, self.rows, self.columns))
        row = np.arange(self.rows)[:, np.newaxis]
        elevation = ((row + jitter[0]) / self.rows - 0.5) * self.vertical_opening
        bearing = ((np.arange(self.columns) + jitter[1]) / self.columns - 0.5) * self.horizontal_opening
        slopes = np.stack([np.ones_like(bearing), np.tan(bearing), np.tan(elevation)], axis=-1)
        slopes /= np.sqrt(np.einsum("...i,...i", slopes, slopes))[..., np.newaxis]
        return slopes.reshape(beams, self.rays, 3)

    def planes(self) -> np.ndarray:
        """Return (4, 3) inward normals: right, left, lower and upper side."""
        across, up = self.horizontal_opening / 2.0, self.vertical_opening / 2.0
        sides = [[math.sin(across), sign * math.cos(across), 0.0] for sign in (1.0, -1.0)]
        return np.array(sides + [[math.sin(up), 0.0, sign * math.cos(up)] for sign in (1.0, -1.0)])


@dataclass(frozen=True)
class FanWithSideLobes(RayPattern):
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


@dataclass(frozen=True)
class ConePattern(RayPattern):
    """Rays spread evenly over a cone of full angle `opening`, rad (thesis 6.4.1, 6.4.2).

    The cone is a pyramid with 16 sides, like a mesh of a cone; each flat side touches the round cone from outside.
    """

    opening: float
    rays: int

    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam: a sunflower, rotated anew for each beam."""
        number = np.arange(self.rays)
        turn = number * math.pi * (3.0 - math.sqrt(5.0)) + 2.0 * math.pi * rng.random((beams, 1))
        radius = math.tan(self.opening / 2.0) * np.sqrt((number + rng.random((beams, self.rays))) / self.rays)
        slopes = np.stack([np.ones_like(turn), radius * np.cos(turn), radius * np.sin(turn)], axis=-1)
        return slopes / np.sqrt(np.einsum("...i,...i", slopes, slopes))[..., np.newaxis]

    def planes(self) -> np.ndarray:
        """Return (16, 3) inward normals; four of them bound the cone below, above, right and left."""
        half = self.opening / 2.0
        turn = np.arange(_SIDES) * 2.0 * math.pi / _SIDES
        return np.column_stack(
            [np.full(_SIDES, math.sin(half)), -math.cos(half) * np.cos(turn), -math.cos(half) * np.sin(turn)]
        )


def head_turns(angles: np.ndarray) -> np.ndarray:
    """Return (beams, 3, 3) rotations from the frames of beams at head `angles` (beams,), rad, to the sonar's frame."""
    angles = np.asarray(angles, dtype=np.float64)
    turns = np.zeros((len(angles), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0] = np.sin(angles)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns
