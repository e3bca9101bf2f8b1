"""The echo models of the thesis, which count contacts (6.4)."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Tuple

import numpy as np

from node_support.parameters import ParameterSet, parameter
from sonar_simulator.echoes.beam_tracer import BeamPattern, ConePattern, Contacts, RayPattern
from sonar_simulator.echoes.ray_caster import Mirrors


@dataclass(frozen=True)
class ContactEchoParameters(ParameterSet):
    """Parameters of all models that count contacts; the defaults are the thesis's values for the laser cone."""

    bins: int = parameter(500, "bins of a beam", low=1, high=4096, thesis_name="binCount", tunable=False)
    max_range: float = parameter(50.0, "range of the last bin's far end", unit="m", low=0.1, high=1000.0)
    spread: float = parameter(1.0, "standard deviation of an echo about its contact", unit="m", low=0.0, high=100.0)
    saturation: int = parameter(127, "greatest strength of a bin", low=1, high=255)
    noise_echoes: int = parameter(15, "noise echoes added to each beam that hits something", low=0, high=10000)
    noise_range_sd: float = parameter(
        4.0, "standard deviation of noise echoes about the nearest contact", unit="m", low=0.0, high=1000.0
    )
    noise_strength_mean: float = parameter(53.0, "mean strength of a noise echo", low=0.0, high=255.0)
    noise_strength_sd: float = parameter(20.0, "standard deviation of a noise echo's strength", low=0.0, high=255.0)


class ContactEcho(ABC):
    """Computes strengths from counts of contacts, with noise echoes around the nearest contact.

    Three things differ from the thesis's code: an echo spreads about the contact itself, not about the
    near end of its bin, which placed surfaces up to a bin too near; echoes of negative range are dropped, not
    added to bin 0; a beam that hits nothing has no echoes, because it has no contact to put noise around.
    """

    mirrors = Mirrors()

    def __init__(self, parameters: ContactEchoParameters) -> None:
        self.parameters = parameters
        self.bins = parameters.bins
        self.max_range = parameters.max_range

    def pattern(self, fan: BeamPattern) -> RayPattern:
        """Return the rays that the model needs for a head whose beam is `fan`: those of `fan`."""
        return fan

    def echoes(self, contacts: Contacts, rng: np.random.Generator) -> np.ndarray:
        """Return strengths (beams, bins) uint8."""
        ranges = np.where(contacts.ranges <= self.max_range, contacts.ranges, np.inf)
        strengths = self.strengths(ranges, rng)
        self._write_noise(strengths, ranges.min(axis=1, initial=np.inf), rng)
        return strengths

    @abstractmethod
    def strengths(self, ranges: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, bins) uint8 without noise for the ranges (beams, contacts) of contacts, m."""

    def counts(self, beams: int, beam: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Return (beams, bins): how many of the echoes at `ranges` (n,) m in beams `beam` (n,) each bin holds."""
        index, inside = self._bin_of(ranges)
        cells = beam[inside] * self.bins + index[inside]
        return np.bincount(cells, minlength=beams * self.bins).reshape(beams, self.bins)

    def _write_noise(self, strengths: np.ndarray, nearest: np.ndarray, rng: np.random.Generator) -> None:
        settings = self.parameters
        beam = np.repeat(np.flatnonzero(np.isfinite(nearest)), settings.noise_echoes)
        ranges = rng.normal(nearest[beam], settings.noise_range_sd)
        noise = rng.normal(settings.noise_strength_mean, settings.noise_strength_sd, size=len(beam))
        index, inside = self._bin_of(ranges)
        strengths[beam[inside], index[inside]] = np.clip(noise[inside], 0, settings.saturation)

    def _bin_of(self, ranges: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return bin numbers, and which of them exist; a bin includes its far end but not its near end."""
        index = np.ceil(ranges * self.bins / self.max_range).astype(np.int64) - 1
        return index, (index >= 0) & (index < self.bins)


@dataclass(frozen=True)
class LaserConeParameters(ContactEchoParameters):
    """Parameters of `LaserCone`; the defaults are the thesis's numbers."""

    echo_strength: int = parameter(15, "strength that one echo adds to its bin", low=0, high=255)


class LaserCone(ContactEcho):
    """Each contact adds one echo of a fixed strength near its range."""

    parameters: LaserConeParameters

    def strengths(self, ranges: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        beam, ray = np.nonzero(np.isfinite(ranges))
        spread = ranges[beam, ray] + rng.normal(0.0, self.parameters.spread, size=len(beam))
        counts = self.counts(len(ranges), beam, spread)
        return np.minimum(counts * self.parameters.echo_strength, self.parameters.saturation).astype(np.uint8)


@dataclass(frozen=True)
class CollisionParameters(ContactEchoParameters):
    """Parameters of `Collision`; the defaults are the thesis's numbers. The thesis's sensor has no noise."""

    spread: float = parameter(0.6, "standard deviation of added contacts about theirs", unit="m", low=0.0, high=100.0)
    noise_echoes: int = parameter(0, "noise echoes written into each beam that hits something", low=0, high=10000)
    opening_deg: float = parameter(
        22.0, "full angle of the round cone", unit="deg", low=0.1, high=150.0, thesis_name="opening"
    )
    increments: int = parameter(10, "contacts added around each contact", low=0, high=1000)


class Collision(ContactEcho):
    """Counts contacts by range, including those added around each contact; the fullest bin is the strongest.

    Contacts come from rays spread over the cone. The thesis used contacts of meshes as its engine reported them, of
    which some were missing and some were where there was nothing (6.4, "sonar cone bug").
    """

    parameters: CollisionParameters

    def pattern(self, fan: BeamPattern) -> RayPattern:
        """Return as many rays as `fan` has, spread over the cone."""
        return ConePattern(math.radians(self.parameters.opening_deg), fan.rays)

    def strengths(self, ranges: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        beam, ray = np.nonzero(np.isfinite(ranges))
        met = ranges[beam, ray]
        added = rng.normal(np.repeat(met, self.parameters.increments), self.parameters.spread)
        all_beams = np.concatenate([beam, np.repeat(beam, self.parameters.increments)])
        counts = self.counts(len(ranges), all_beams, np.concatenate([met, added]))
        fullest = np.maximum(counts.max(axis=1, keepdims=True), 1)
        # Rounded up, so that a single contact is heard beside any number of others.
        return (-(-self.parameters.saturation * counts // fullest)).astype(np.uint8)
