"""The thesis's laser-cone echo model (6.4.3)."""

from dataclasses import dataclass

import numpy as np

from node_support.parameters import parameter
from sonar_simulator.echoes.contact_echo import ContactEcho, ContactEchoParameters


@dataclass(frozen=True)
class LaserConeParameters(ContactEchoParameters):
    """Parameters of `LaserCone`; the defaults are the thesis's numbers."""

    echo_strength: int = parameter(15, "strength that one echo adds to its bin", low=0, high=255)


class LaserCone(ContactEcho):
    """Each contact adds one echo of a fixed strength near its range."""

    def __init__(self, parameters: LaserConeParameters) -> None:
        super().__init__(parameters)
        self.parameters = parameters

    def strengths(self, ranges: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, bins) uint8 without noise for the ranges (beams, contacts) of contacts, m."""
        beam, ray = np.nonzero(np.isfinite(ranges))
        spread = ranges[beam, ray] + rng.normal(0.0, self.parameters.spread, size=len(beam))
        counts = self.counts(len(ranges), beam, spread)
        return np.minimum(counts * self.parameters.echo_strength, self.parameters.saturation).astype(np.uint8)
