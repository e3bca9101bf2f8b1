"""The thesis's collision echo model (6.4.1): counts all contacts of a cone with the world."""

import math
from dataclasses import dataclass

import numpy as np

from node_support.parameters import parameter
from sonar_simulator.echoes.contact_echo import ContactEcho, ContactEchoParameters
from sonar_simulator.rays.beam_pattern import BeamPattern, RayPattern
from sonar_simulator.rays.cone_pattern import ConePattern


@dataclass(frozen=True)
class CollisionParameters(ContactEchoParameters):
    """Parameters of `Collision`; the defaults are the thesis's numbers. The thesis's sensor has no noise."""

    spread: float = parameter(
        0.6, "standard deviation of the added contacts about their contact", unit="m", low=0.0, high=100.0
    )
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

    def __init__(self, parameters: CollisionParameters) -> None:
        super().__init__(parameters)
        self.parameters = parameters

    def pattern(self, fan: BeamPattern) -> RayPattern:
        """Return as many rays as `fan` has, spread over the cone."""
        return ConePattern(math.radians(self.parameters.opening_deg), fan.rays)

    def strengths(self, ranges: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, bins) uint8 without noise for the ranges (beams, contacts) of contacts, m."""
        beam, ray = np.nonzero(np.isfinite(ranges))
        met = ranges[beam, ray]
        added = rng.normal(np.repeat(met, self.parameters.increments), self.parameters.spread)
        all_beams = np.concatenate([beam, np.repeat(beam, self.parameters.increments)])
        counts = self.counts(len(ranges), all_beams, np.concatenate([met, added]))
        fullest = np.maximum(counts.max(axis=1, keepdims=True), 1)
        # Rounded up, so that a single contact is heard beside any number of others.
        return (-(-self.parameters.saturation * counts // fullest)).astype(np.uint8)
