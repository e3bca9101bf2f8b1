"""The rays that represent one beam, and the planes that bound it."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class RayPattern(Protocol):
    """Rays inside a beam that is a convex pyramid; the beam's frame has x along its axis and z up."""

    @property
    def rays(self) -> int:
        """Number of rays in one beam."""

    @property
    def rays_inside(self) -> int:
        """Number of rays, from the first, that are between the planes."""

    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam, drawn anew for each beam."""

    def shares(self) -> np.ndarray:
        """Return (rays,) the share of the beam's solid angle that each ray represents."""

    def planes(self) -> np.ndarray:
        """Return (k, 3) unit normals, inward, of the planes through the sonar that bound the beam."""


@dataclass(frozen=True)
class BeamPattern:
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

    @property
    def rays_inside(self) -> int:
        """Number of rays between the planes: all."""
        return self.rays

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

    def shares(self) -> np.ndarray:
        """Return (rays,) equal shares."""
        return np.full(self.rays, 1.0 / self.rays)

    def planes(self) -> np.ndarray:
        """Return (4, 3) inward normals: right, left, lower and upper side."""
        across, up = self.horizontal_opening / 2.0, self.vertical_opening / 2.0
        sides = [[math.sin(across), sign * math.cos(across), 0.0] for sign in (1.0, -1.0)]
        return np.array(sides + [[math.sin(up), 0.0, sign * math.cos(up)] for sign in (1.0, -1.0)])

    def directions(self, angles: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the sonar frame for head `angles` (beams,), rad.

        Angles count counter-clockwise about +z from +x.
        """
        return self.sample(len(angles), rng) @ head_turns(angles).transpose(0, 2, 1)


def head_turns(angles: np.ndarray) -> np.ndarray:
    """Return (beams, 3, 3) rotations from the frames of beams at head `angles` (beams,), rad, to the sonar's frame."""
    angles = np.asarray(angles, dtype=np.float64)
    turns = np.zeros((len(angles), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0] = np.sin(angles)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns
