"""The interface of echo models, and the table from which a parameter selects one."""

from enum import Enum
from typing import Any, Callable, Dict, Mapping, NamedTuple, Protocol, Type

import numpy as np

from node_support.parameters import ParameterSet
from sonar_simulator.echoes.beam_tracer import BeamPattern, Contacts, RayPattern
from sonar_simulator.echoes.physical import Physical, PhysicalParameters
from sonar_simulator.echoes.ray_caster import Mirrors
from sonar_simulator.echoes.thesis_models import Collision, CollisionParameters, LaserCone, LaserConeParameters


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


class EchoModelName(Enum):
    """Which model turns contacts into echoes."""

    LASER_CONE = "laser_cone"
    COLLISION = "collision"
    PHYSICAL = "physical"


ECHO_MODELS: Dict[str, EchoModelKind] = {
    EchoModelName.LASER_CONE.value: EchoModelKind(LaserConeParameters, LaserCone),
    EchoModelName.COLLISION.value: EchoModelKind(CollisionParameters, Collision),
    EchoModelName.PHYSICAL.value: EchoModelKind(PhysicalParameters, Physical),
}


def make_echo_model(name: str, values: Mapping[str, Any]) -> EchoModel:
    """Build the model called `name` from plain parameter values; raises ParameterError for one that is not allowed."""
    kind = ECHO_MODELS[name]
    return kind.build(kind.parameters.from_mapping(values))
