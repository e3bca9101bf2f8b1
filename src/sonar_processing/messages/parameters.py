"""Parameters for messages of beams whose angles are not what is documented."""

from dataclasses import dataclass
from enum import Enum

from node_support.parameters import ParameterSet, parameter


class AngleUnitChoice(Enum):
    """Unit of the head's angle in the messages."""

    TYPE = "TYPE"
    RADIANS = "RADIANS"
    DEGREES = "DEGREES"
    GRADIANS = "GRADIANS"


class HeadTurns(Enum):
    """Which way the angles in the messages grow, seen from the tip of +z of their frame."""

    TYPE = "TYPE"
    COUNTER_CLOCKWISE = "COUNTER_CLOCKWISE"
    CLOCKWISE = "CLOCKWISE"


@dataclass(frozen=True)
class BeamMessageParameters(ParameterSet):
    """How the angles in messages of beams are understood."""

    angle_unit: AngleUnitChoice = parameter(
        AngleUnitChoice.TYPE,
        "unit of the head's angle; TYPE: as documented for the type of the messages, gradians told by their values",
        tunable=False,
    )
    head_turns: HeadTurns = parameter(
        HeadTurns.TYPE,
        "which way the head's angle grows, seen from the tip of +z; TYPE: as documented for the type of the messages",
        tunable=False,
    )
