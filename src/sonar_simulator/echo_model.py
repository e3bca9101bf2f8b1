"""What an echo model is, and the table of those that a parameter can pick."""

from typing import Any, Callable, Dict, Mapping, NamedTuple, Protocol, Type

import numpy as np

from node_support.parameters import ParameterError, ParameterSet
from sonar_simulator.laser_cone import LaserCone, LaserConeParameters


class EchoModel(Protocol):
    """Turns ray distances into echo strengths."""

    bins: int
    max_range: float

    def echoes(self, distances: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return strengths (..., bins) uint8 for ray distances (..., rays) in m, inf where nothing is hit."""


class EchoModelKind(NamedTuple):
    """A model's parameters and how it is built from them."""

    parameters: Type[ParameterSet]
    build: Callable[[Any], EchoModel]


ECHO_MODELS: Dict[str, EchoModelKind] = {
    "laser_cone": EchoModelKind(LaserConeParameters, LaserCone),
}


def make_echo_model(name: str, values: Mapping[str, Any]) -> EchoModel:
    """Build the model called `name` from plain parameter values.

    Raises ParameterError for a name or a value that is not allowed.
    """
    if name not in ECHO_MODELS:
        raise ParameterError(f"echo_model = {name!r}: must be one of {', '.join(ECHO_MODELS)}")
    kind = ECHO_MODELS[name]
    return kind.build(kind.parameters.from_mapping(values))
