"""Beams made of what Gazebo's rays hit."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Dict, Type

import numpy as np

from node_support.headers import StampParameters
from node_support.parameters import ParameterSet, parameter
from sonar_simulator.echoes.echo_model import ECHO_MODELS, EchoModel, EchoModelName
from sonar_simulator.echoes.ray_grid import Rays, contacts_of_grid
from sonar_simulator.simulation.simulation import Ping
from sonar_simulator.simulation.sonar_head import SonarHead


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


@dataclass(frozen=True)
class RayScan:
    """One scan of a ray sensor: its rays, its stamp in ns and its frame."""

    rays: Rays
    stamp_ns: int
    frame_id: str


class GazeboBeams:
    """Makes beams from what the rays hit. The same seed and scans give the same beams."""

    def __init__(self, model: EchoModel, seed: int) -> None:
        self._model = model
        self._rng = np.random.default_rng(seed)

    @property
    def max_range(self) -> float:
        """Far end of the last bin, m."""
        return self._model.max_range

    def turned(self, scan: RayScan, T_sonar_rays: np.ndarray) -> Ping:
        """Return the beam of a sensor that has turned to the (4, 4) pose; all its rays belong to the beam."""
        return self._ping(math.atan2(T_sonar_rays[1, 0], T_sonar_rays[0, 0]), scan.rays)

    def swept(self, scan: RayScan, head: SonarHead, beam: int, opening: float) -> Ping:
        """Return beam number `beam`, `opening` rad wide, of a sensor that sees the whole circle.

        Raises RefusedInput if there is no ray within it.
        """
        angle = head.angle(beam)
        return self._ping(angle, scan.rays.within(angle, opening))

    def _ping(self, angle: float, rays: Rays) -> Ping:
        return Ping(angle, self._model.echoes(contacts_of_grid(rays), self._rng)[0])
