"""The rays that stand for one fan-shaped beam."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class BeamPattern:
    """A pyramid of rows x columns rays, one in each stratum of equal angles (thesis 4.1.1, 6.4.3).

    vertical_opening, horizontal_opening: full angles of the beam, rad.
    """

    vertical_opening: float
    horizontal_opening: float
    rows: int
    columns: int

    @property
    def rays(self) -> int:
        """Number of rays in one beam."""
        return self.rows * self.columns

    def directions(self, angles: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the sonar frame for head `angles` (beams,), rad.

        Angles count counter-clockwise about +z from +x.
        Every beam gets a jitter of its own: rays at fixed elevations would draw the floor as concentric arcs.
        """
        angles = np.asarray(angles, dtype=np.float64)
        jitter = rng.random((2, len(angles), self.rows, self.columns))
        row = np.arange(self.rows)[:, np.newaxis]
        elevation = ((row + jitter[0]) / self.rows - 0.5) * self.vertical_opening
        bearing = ((np.arange(self.columns) + jitter[1]) / self.columns - 0.5) * self.horizontal_opening
        bearing += angles[:, np.newaxis, np.newaxis]
        level = np.cos(elevation)
        unit = np.stack([level * np.cos(bearing), level * np.sin(bearing), np.sin(elevation)], axis=-1)
        return unit.reshape(len(angles), self.rays, 3)
