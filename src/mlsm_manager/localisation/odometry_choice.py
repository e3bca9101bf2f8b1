"""Which odometry a vehicle has, and what that means for the joint solver."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, Callable, Dict

import numpy as np

from mlsm_manager.joint_solver.motion.dvl_factors import DvlFactors
from mlsm_manager.joint_solver.motion.heading_factors import HeadingFactors
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.motion.odometry_parameters import (
    DvlOdometry,
    HeadingOdometry,
    ThrusterOdometry,
    UnaidedOdometry,
)
from mlsm_manager.joint_solver.motion.thruster_factors import ThrusterFactors
from mlsm_manager.joint_solver.motion.unaided_factors import UnaidedFactors
from mlsm_manager.scan_matching.prediction import OdometryErrors
from node_support.parameters import ParameterSet, parameter

# s and rad: stand for a heading that no compass holds; only the walk of the turn rate moves it.
_FOR_EVER = 1e6
_NO_COMPASS = 1e-5
# rad/sqrt(s): the solver needs some freedom of the heading from scan to scan.
_LEAST_WALK = 1e-6


class OdometryKind(Enum):
    """What a vehicle knows of its own motion."""

    DVL = "DVL"
    THRUSTERS = "THRUSTERS"
    HEADING = "HEADING"
    HOVERING = "HOVERING"
    NONE = "NONE"


@dataclass(frozen=True)
class OdometryChoice(ParameterSet):
    """What the joint solver needs to know of the odometry besides OdometryErrors."""

    odometry: OdometryKind = parameter(
        OdometryKind.DVL,
        "what the joint solver takes from the odometry. DVL: positions that are right to some percent. THRUSTERS: "
        "positions whose scale is unknown and walks, in a current. HEADING: the heading alone; HOVERING: "
        "also, of a vehicle that stops and strafes. NONE: nothing",
        tunable=False,
    )  # fmt: skip
    odometry_scale: float = parameter(
        0.0, "true distance over reported distance, minus 1, as known beforehand", low=-0.9, high=9.0, tunable=False
    )
    odometry_direction: float = parameter(
        0.0, "angle from reported to true motion, as known beforehand", unit="rad", low=-3.2, high=3.2, tunable=False
    )
    heading_time: float = parameter(
        300.0, "how long an error of the compass lasts", unit="s", low=1.0, high=1e6, tunable=False
    )
    current_deviation: float = parameter(
        0.05, "THRUSTERS: standard deviation of the current in each direction", unit="m/s", low=0.0, high=5.0,
        tunable=False,
    )  # fmt: skip
    current_walk: float = parameter(
        0.002, "THRUSTERS: random walk of the current", unit="m/s/sqrt(s)", low=0.0, high=1.0, tunable=False
    )
    start_speed_deviation: float = parameter(
        0.3,
        "HEADING, HOVERING, NONE: standard deviation of the speed ahead when matching begins; 0.02 for a standing "
        "start", unit="m/s", low=0.0, high=5.0, tunable=False,
    )  # fmt: skip
    travel_walk: float = parameter(
        0.005, "HEADING, HOVERING, NONE: random walk of the speed of travel, around which the speed ahead changes",
        unit="m/s/sqrt(s)", low=0.0, high=1.0, tunable=False,
    )  # fmt: skip
    slip_deviation: float = parameter(
        0.07, "HEADING, HOVERING, NONE: standard deviation of the speed sideways",
        unit="m/s", low=0.001, high=5.0, tunable=False,
    )  # fmt: skip
    slip_time: float = parameter(
        20.0, "HEADING, HOVERING, NONE: how long a speed sideways lasts", unit="s", low=1.0, high=1e5, tunable=False
    )
    turn_rate_time: float = parameter(
        10.0, "NONE: how long a turn rate lasts", unit="s", low=1.0, high=1e5, tunable=False
    )

    def odometry_model(self, errors: OdometryErrors) -> OdometryModel:
        """Return the model of the motion."""
        return _MODELS[self.odometry](self, errors)


def _compass(choice: OdometryChoice, errors: OdometryErrors) -> Dict[str, Any]:
    compass = errors.heading_deviation > 0.0
    return {
        "heading_deviation": errors.heading_deviation if compass else _NO_COMPASS,
        "heading_time": choice.heading_time if compass else _FOR_EVER,
        "heading_walk": max(errors.turn_rate_deviation * np.sqrt(2.0 * errors.rate_time), _LEAST_WALK),
    }


def _positions(choice: OdometryChoice, errors: OdometryErrors) -> Dict[str, Any]:
    """Return the walks that errors add up to which last `rate_time`, and `motion_time`."""
    return {
        **_compass(choice, errors),
        "position_walk": max(errors.speed_deviation * np.sqrt(2.0 * errors.rate_time), 1e-3),
        "direction": choice.odometry_direction,
        "direction_deviation": errors.direction_deviation,
        "direction_walk": min(errors.direction_deviation * np.sqrt(2.0 / errors.motion_time), 1.0),
        "scale": choice.odometry_scale,
        "scale_deviation": errors.scale_deviation,
    }


def _speeds(choice: OdometryChoice, errors: OdometryErrors) -> Dict[str, Any]:
    return {
        "start_speed_deviation": choice.start_speed_deviation,
        "speed_deviation": max(errors.speed_deviation, 1e-3),
        "speed_time": max(errors.rate_time, 1.0),
        "travel_walk": choice.travel_walk,
        "slip_deviation": choice.slip_deviation,
        "slip_time": choice.slip_time,
    }


def _dvl(choice: OdometryChoice, errors: OdometryErrors) -> OdometryModel:
    return DvlFactors(DvlOdometry(**_positions(choice, errors)))


def _thrusters(choice: OdometryChoice, errors: OdometryErrors) -> OdometryModel:
    scale_walk = min(errors.scale_deviation * np.sqrt(2.0 / errors.motion_time), 1.0)
    current = {"current_deviation": choice.current_deviation, "current_walk": choice.current_walk}
    return ThrusterFactors(ThrusterOdometry(**_positions(choice, errors), scale_walk=scale_walk, **current))


def _heading(choice: OdometryChoice, errors: OdometryErrors) -> OdometryModel:
    return HeadingFactors(HeadingOdometry(**_compass(choice, errors), **_speeds(choice, errors)))


def _none(choice: OdometryChoice, errors: OdometryErrors) -> OdometryModel:
    turn_rate = {
        "turn_rate_deviation": max(errors.turn_rate_deviation, 1e-5), "turn_rate_time": choice.turn_rate_time
    }  # fmt: skip
    return UnaidedFactors(UnaidedOdometry(**_speeds(choice, errors), **turn_rate))


_MODELS: Dict[OdometryKind, Callable[[OdometryChoice, OdometryErrors], OdometryModel]] = {
    OdometryKind.DVL: _dvl,
    OdometryKind.THRUSTERS: _thrusters,
    OdometryKind.HEADING: _heading,
    OdometryKind.HOVERING: _heading,
    OdometryKind.NONE: _none,
}
