"""Parameters of gazebo_sonar."""

from dataclasses import dataclass
from enum import Enum
from typing import Dict, Type

from node_support.headers import StampParameters
from node_support.parameters import ParameterSet, parameter
from sonar_simulator.echoes.echo_model import ECHO_MODELS, EchoModelName


class HeadMode(Enum):
    """What turns the head."""

    SWEEP = "SWEEP"
    JOINT = "JOINT"


@dataclass(frozen=True)
class GazeboSonarParameters(StampParameters):
    """How rays become beams."""

    head: HeadMode = parameter(
        HeadMode.SWEEP,
        "SWEEP: the ray sensor sees the whole circle, and each scan gives the next beam; JOINT: it turns on a joint",
        tunable=False,
    )
    beams_per_turn: int = parameter(120, "SWEEP: beams in a full turn", low=1, high=3600, tunable=False)
    horizontal_opening_deg: float = parameter(
        2.5, "SWEEP: rays within this angle make one beam", unit="deg", low=0.01, high=360.0, tunable=False
    )
    vertical_opening_deg: float = parameter(
        22.0, "LaserScan: angle from the ray sensor's lowest row to its highest; clouds do not need it", unit="deg",
        low=0.0, high=179.0, tunable=False,
    )  # fmt: skip
    ray_rows: int = parameter(
        0, "clouds: vertical samples of the ray sensor; 0: found out, for sensors that see less than 180 deg", low=0,
        high=1000, tunable=False,
    )  # fmt: skip
    nothing_range: float = parameter(
        50.0, "clouds: distance of points that hit nothing: the ray sensor's greatest range minus its smallest",
        unit="m", low=0.1, high=10000.0, tunable=False,
    )  # fmt: skip
    frame_id: str = parameter("sonar", "frame of the beams, which tilts but does not turn with the head", tunable=False)
    sensor_joint: str = parameter(
        "sonar_servo_joint", "joint of /joint_states that tilts the sonar, for sensorAngle; empty: none", tunable=False,
        may_be_empty=True,
    )  # fmt: skip
    echo_model: EchoModelName = parameter(EchoModelName.LASER_CONE, "how contacts become echoes", tunable=False)
    seed: int = parameter(1, "seed of all random numbers", low=0, high=2**31 - 1, tunable=False)


GROUPS: Dict[str, Type[ParameterSet]] = {name: kind.parameters for name, kind in ECHO_MODELS.items()}
"""Groups of parameters, one for each echo model; the one that `echo_model` names is used."""
