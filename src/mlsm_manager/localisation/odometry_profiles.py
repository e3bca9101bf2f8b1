"""Which odometry a vehicle has: for each kind its model of the motion, and where the values of its parameters are."""

from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from typing import Any, Callable, Dict, Mapping, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult, fit_of
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.motion_models import Compass, OdometryModel
from mlsm_manager.joint_solver.position_models import DvlFactors, PositionOdometry, ThrusterFactors, UnsureFactors
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.velocity_models import HeadingFactors, Speeds, UnaidedFactors
from mlsm_manager.scan_matching.prediction import OdometryErrors
from node_support.files import package_folder
from node_support.parameters import EXPERT, parameter, read_values

# s and rad: stand for a heading that no compass holds; only the walk of the turn rate moves it.
_FOR_EVER = 1e6
_NO_COMPASS = 1e-5
# rad/sqrt(s): the solver needs some freedom of the heading from scan to scan; of an unknown turn rate, besides it.
_LEAST_WALK = 1e-6
_TURN_NOISE = 3.5e-4


class OdometryKind(Enum):
    """What a vehicle knows of its own motion."""

    AUTO = "AUTO"
    DVL = "DVL"
    THRUSTERS = "THRUSTERS"
    HEADING = "HEADING"
    HOVERING = "HOVERING"
    NONE = "NONE"


COMPASS_ONLY = (OdometryKind.HEADING, OdometryKind.HOVERING)
"""Kinds whose velocities are estimated from echoes, and taken by dead_reckoning."""


@dataclass(frozen=True)
class OdometryChoice(OdometryErrors):
    """What the odometry measures and how wrong it may be."""

    odometry: OdometryKind = parameter(
        OdometryKind.AUTO,
        "what the joint solver takes from the odometry. AUTO: what tf and the echoes tell. DVL: positions that are "
        "right to some percent. THRUSTERS: positions whose scale is unknown and walks, in a current. HEADING: the "
        "heading alone; HOVERING: also, of a vehicle that stops and strafes. NONE: nothing", tunable=False,
    )  # fmt: skip
    odometry_scale: float = parameter(
        0.0, "true distance over reported distance, minus 1, as known beforehand", low=-0.9, high=9.0, tunable=False
    )
    odometry_direction: float = parameter(
        0.0, "angle from reported to true motion, as known beforehand", unit="rad", low=-3.2, high=3.2, tunable=False
    )
    heading_correlation_time: float = parameter(
        300.0, "how long an error of the compass lasts", unit="s", low=1.0, high=1e6, tunable=False,
        expert="five minutes: iron and tilt change a compass's error that slowly",
    )  # fmt: skip
    current_deviation: float = parameter(
        0.05, "THRUSTERS: standard deviation of the current in each direction", unit="m/s", low=0.0, high=5.0,
        tunable=False, expert="a current in sheltered water",
    )  # fmt: skip
    current_walk: float = parameter(
        0.002, "THRUSTERS: random walk of the current", unit="m/s/sqrt(s)", low=0.0, high=1.0, tunable=False,
        expert="the current may change by 0.05 m/s in ten minutes",
    )  # fmt: skip
    start_speed_deviation: float = parameter(
        0.3, "HEADING, HOVERING, NONE: standard deviation of the speed ahead when matching begins; 0.02 for a standing "
        "start", unit="m/s", low=0.0, high=5.0, tunable=False,
    )  # fmt: skip
    travel_walk: float = parameter(
        0.005, "HEADING, HOVERING, NONE: random walk of the speed of travel, around which the speed ahead changes",
        unit="m/s/sqrt(s)", low=0.0, high=1.0, tunable=False,
        expert="the speed of travel may change by 0.1 m/s in seven minutes",
    )  # fmt: skip
    slip_deviation: float = parameter(
        0.07, "HEADING, HOVERING, NONE: standard deviation of the speed sideways", unit="m/s", low=0.001, high=5.0,
        tunable=False, expert="vehicles go ahead; they slip in turns and in a slow current",
    )  # fmt: skip
    slip_correlation_time: float = parameter(
        20.0, "HEADING, HOVERING, NONE: how long a speed sideways lasts", unit="s", low=1.0, high=1e5, tunable=False,
        expert="a turn",
    )  # fmt: skip
    turn_rate_correlation_time: float = parameter(
        10.0, "NONE: how long a turn rate lasts", unit="s", low=1.0, high=1e5, tunable=False, expert="a turn",
    )  # fmt: skip

    def odometry_model(self) -> OdometryModel:
        return _MODELS[self.odometry](self)

    def node_search(self, parts_per_turn: int) -> Any:
        """Return what finds the nodes of parts of a turn, of which echoes alone tell; None where it is not needed."""
        if parts_per_turn == 1 or self.odometry not in COMPASS_ONLY:
            return None
        # Loaded only for vehicles that need it, because of its compiled loops.
        from mlsm_manager.hovering.particle_filter import ParticleFilter

        return ParticleFilter()


def _compass(own: OdometryChoice) -> Compass:
    compass = own.heading_deviation > 0.0
    return Compass(
        heading_deviation=own.heading_deviation if compass else _NO_COMPASS,
        heading_correlation_time=own.heading_correlation_time if compass else _FOR_EVER,
        heading_walk=max(own.turn_rate_deviation * np.sqrt(2.0 * own.rate_correlation_time), _LEAST_WALK),
    )


def _positions(own: OdometryChoice) -> PositionOdometry:
    """Return the walks that errors add up to which last `rate_correlation_time`, and `motion_correlation_time`."""
    return PositionOdometry(
        compass=_compass(own),
        position_walk=max(own.speed_deviation * np.sqrt(2.0 * own.rate_correlation_time), 1e-3),
        direction=own.odometry_direction,
        direction_deviation=own.direction_deviation,
        direction_walk=min(own.direction_deviation * np.sqrt(2.0 / own.motion_correlation_time), 1.0),
        scale=own.odometry_scale,
        scale_deviation=own.scale_deviation,
    )


def _speeds(own: OdometryChoice) -> Speeds:
    return Speeds(
        start_speed_deviation=own.start_speed_deviation,
        speed_deviation=max(own.speed_deviation, 1e-3),
        speed_correlation_time=max(own.rate_correlation_time, 1.0),
        travel_walk=own.travel_walk,
        slip_deviation=own.slip_deviation,
        slip_correlation_time=own.slip_correlation_time,
    )


def _thrusters(own: OdometryChoice) -> OdometryModel:
    scale_walk = min(own.scale_deviation * np.sqrt(2.0 / own.motion_correlation_time), 1.0)
    current = {"current_deviation": own.current_deviation, "current_walk": own.current_walk}
    return ThrusterFactors(replace(_positions(own), scale_walk=scale_walk, **current))


def _none(own: OdometryChoice) -> OdometryModel:
    deviation = max(own.turn_rate_deviation, 1e-5)
    return UnaidedFactors(_speeds(own), deviation, own.turn_rate_correlation_time, _TURN_NOISE)


_MODELS: Dict[OdometryKind, Callable[[OdometryChoice], OdometryModel]] = {
    OdometryKind.AUTO: lambda own: UnsureFactors(_positions(own)),
    OdometryKind.DVL: lambda own: DvlFactors(_positions(own)),
    OdometryKind.THRUSTERS: _thrusters,
    OdometryKind.HEADING: lambda own: HeadingFactors(_speeds(own), _compass(own)),
    OdometryKind.HOVERING: lambda own: HeadingFactors(_speeds(own), _compass(own)),
    OdometryKind.NONE: _none,
}


def fitted(solver: LiveSolver) -> BatchResult:
    """Return the fit of a whole run: from several paths where echoes alone tell the motion within a turn."""
    if solver.parameters.node_search is None:
        return fit_of(solver.solution)
    from mlsm_manager.hovering.best_fit import solved_best

    return solved_best(solver)


def strafes(ahead: LiveSolver, hovering: LiveSolver, without_faults: Sequence[Tuple[RunLog, Solution]] = ()) -> bool:
    """Return whether echoes are clearly likelier with HOVERING than with HEADING. Both solvers took the same scans.

    without_faults: what `hovering` had logged without faults, and runs with HEADING without them.
    """
    from mlsm_manager.hovering import best_fit

    return best_fit.strafes(ahead, hovering, without_faults)


@lru_cache(maxsize=None)
def profile_values(kind: OdometryKind) -> Mapping[str, Any]:
    """Return the parameters of mlsm_core that the yaml file of a profile sets, by their names."""
    values = read_values(package_folder() / f"yaml/odometry_{kind.value.lower()}.yaml")["mlsm_core"]
    experts = values.pop(EXPERT)
    return {**values, **experts}
