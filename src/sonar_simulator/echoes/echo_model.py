"""The interface of echo models, and the table from which a parameter selects one."""

from typing import Any, Callable, Dict, Mapping, NamedTuple, Protocol, Type

import numpy as np

from node_support.parameters import ParameterError, ParameterSet
from sonar_simulator.echoes.physical import Physical, PhysicalParameters
from sonar_simulator.echoes.thesis_models import Collision, CollisionParameters, LaserCone, LaserConeParameters
from sonar_simulator.rays.beam_pattern import BeamPattern, RayPattern
from sonar_simulator.rays.beam_tracer import Contacts
from sonar_simulator.rays.ray_caster import Mirrors


class EchoModel(Protocol):
    """Turns contacts into echo strengths, and says which rays have to be cast for that."""

    bins: int
    max_range: float
    mirrors: Mirrors

    def pattern(self, fan: BeamPattern) -> RayPattern:
        """Return the rays that the model needs for a head whose beam is `fan`."""

    def echoes(self, contacts: Contacts, rng: np.random.Generator) -> np.ndarray:
        """Return strengths (beams, bins) uint8."""


class EchoModelKind(NamedTuple):
    """A model's parameters and how it is built from them."""

    parameters: Type[ParameterSet]
    build: Callable[[Any], EchoModel]


ECHO_MODELS: Dict[str, EchoModelKind] = {
    "laser_cone": EchoModelKind(LaserConeParameters, LaserCone),
    "collision": EchoModelKind(CollisionParameters, Collision),
    "physical": EchoModelKind(PhysicalParameters, Physical),
}


def make_echo_model(name: str, values: Mapping[str, Any]) -> EchoModel:
    """Build the model called `name` from plain parameter values.

    Raises ParameterError for a name or a value that is not allowed.
    """
    if name not in ECHO_MODELS:
        raise ParameterError(f"echo_model = {name!r}: must be one of {', '.join(ECHO_MODELS)}")
    kind = ECHO_MODELS[name]
    return kind.build(kind.parameters.from_mapping(values))
