"""The thesis's laser-cone echo model (6.4.3)."""

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from node_support.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class LaserConeParameters(ParameterSet):
    """Parameters of `LaserCone`; the defaults are the thesis's numbers."""

    bins: int = parameter(500, "bins of a beam", low=1, high=4096, thesis_name="binCount", tunable=False)
    max_range: float = parameter(50.0, "range of the last bin's far end", unit="m", low=0.1, high=1000.0)
    spread: float = parameter(1.0, "standard deviation of an echo about its contact", unit="m", low=0.0, high=100.0)
    echo_strength: int = parameter(15, "strength that one echo adds to its bin", low=0, high=255)
    saturation: int = parameter(127, "greatest strength of a bin", low=1, high=255)
    noise_echoes: int = parameter(15, "noise echoes written into each beam that hits something", low=0, high=10000)
    noise_range_sd: float = parameter(
        4.0, "standard deviation of noise echoes about the nearest contact", unit="m", low=0.0, high=1000.0
    )
    noise_strength_mean: float = parameter(53.0, "mean strength of a noise echo", low=0.0, high=255.0)
    noise_strength_sd: float = parameter(20.0, "standard deviation of a noise echo's strength", low=0.0, high=255.0)


class LaserCone:
    """Echo strengths from the distances of a beam's rays.

    Each contact adds one echo near its range; then noise echoes overwrite bins around the nearest contact.
    Three things differ from the thesis's code: an echo spreads about the contact itself and not about the
    near end of its bin, which drew surfaces up to a bin too near; echoes of negative range are dropped, not
    heaped into bin 0; a beam that hits nothing stays silent, it has no contact to lay noise around.
    """

    def __init__(self, parameters: LaserConeParameters) -> None:
        self.parameters = parameters

    @property
    def bins(self) -> int:
        """Number of bins in a beam."""
        return self.parameters.bins

    @property
    def max_range(self) -> float:
        """Far end of the last bin, m."""
        return self.parameters.max_range

    def echoes(self, distances: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return strengths (..., bins) uint8 for ray distances (..., rays) in m, inf where nothing is hit."""
        beams = np.atleast_2d(distances)
        beams = np.where(beams <= self.max_range, beams, np.inf)
        strengths = self._contacts(beams, rng)
        self._write_noise(strengths, beams.min(axis=1), rng)
        return strengths.reshape((*np.shape(distances)[:-1], self.bins))

    def _contacts(self, beams: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        beam, ray = np.nonzero(np.isfinite(beams))
        ranges = beams[beam, ray] + rng.normal(0.0, self.parameters.spread, size=len(beam))
        index, inside = self._bin_of(ranges)
        cells = beam[inside] * self.bins + index[inside]
        counts = np.bincount(cells, minlength=len(beams) * self.bins)
        strengths = np.minimum(counts * self.parameters.echo_strength, self.parameters.saturation)
        return strengths.astype(np.uint8).reshape(len(beams), self.bins)

    def _write_noise(self, strengths: np.ndarray, nearest: np.ndarray, rng: np.random.Generator) -> None:
        settings = self.parameters
        beam = np.repeat(np.flatnonzero(np.isfinite(nearest)), settings.noise_echoes)
        ranges = rng.normal(nearest[beam], settings.noise_range_sd)
        noise = rng.normal(settings.noise_strength_mean, settings.noise_strength_sd, size=len(beam))
        index, inside = self._bin_of(ranges)
        strengths[beam[inside], index[inside]] = np.clip(noise[inside], 0, settings.saturation)

    def _bin_of(self, ranges: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        index = np.ceil(ranges * self.bins / self.max_range).astype(np.int64) - 1
        return index, (index >= 0) & (index < self.bins)
