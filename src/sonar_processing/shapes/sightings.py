"""Echoes together with the beams and places they were seen from."""

from dataclasses import dataclass, replace

import numpy as np

from sonar_processing.shapes.beam_echoes import BeamEchoes


@dataclass(frozen=True)
class Sightings:
    """Echoes in the order of their beams.

    points: (n, 2) x y [m]. origins: (n, 2) where the sonar was. beams: (n,) number of the beam, growing; a beam without
    echoes has a number too. weights: (n,) number of cloud points in each echo.
    lengths: (n,) of each echo along its beam, m.
    step: usual angle from beam to beam, rad, in the cloud's frame: a vehicle that turns with its head widens it.
    """

    points: np.ndarray
    origins: np.ndarray
    beams: np.ndarray
    weights: np.ndarray
    lengths: np.ndarray
    step: float

    @property
    def ranges(self) -> np.ndarray:
        """(n,) distance from the sonar, m."""
        return np.linalg.norm(self.points - self.origins, axis=1)

    @property
    def towards(self) -> np.ndarray:
        """(n, 2) unit vectors from the sonar."""
        return (self.points - self.origins) / np.maximum(self.ranges, 1e-9)[:, np.newaxis]

    def only(self, chosen: np.ndarray) -> "Sightings":
        """Return the echoes at indices `chosen` (k,)."""
        parts = {name: getattr(self, name)[chosen] for name in ("points", "origins", "beams", "weights", "lengths")}
        return replace(self, **parts)


def sightings(echoes: BeamEchoes, chosen: np.ndarray, origins: np.ndarray) -> Sightings:
    """Return the echoes at indices `chosen` (n,), seen from origins (n, 2) x y [m]."""
    points = echoes.points[chosen]
    taken, first, inverse = np.unique(echoes.time_stamps[chosen], return_index=True, return_inverse=True)
    numbers = _beam_numbers(taken)
    axes = (points - origins)[first]
    steps = np.abs(np.diff(np.unwrap(np.arctan2(axes[:, 1], axes[:, 0])))) / np.diff(numbers)
    steps = steps[steps > 0.0]
    step = float(np.median(steps)) if len(steps) else 0.0
    return Sightings(points, origins, numbers[inverse], echoes.weights[chosen], echoes.lengths[chosen], step)


def _beam_numbers(taken: np.ndarray) -> np.ndarray:
    """Return (b,) numbers of beams taken at growing times (b,) [s]; long intervals hold beams that heard nothing."""
    intervals = np.diff(taken)
    if not len(intervals):
        return np.zeros(len(taken), dtype=int)
    counts = np.maximum(np.rint(intervals / np.median(intervals)).astype(int), 1)
    return np.append(0, np.cumsum(counts))
