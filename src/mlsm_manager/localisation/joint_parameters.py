"""Parameters of the joint solver in a vehicle's words: what is known of its odometry, its compass and its sonar."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.multi_view.parameters import (
    DvlOdometry,
    MultiViewParameters,
    SolverWindow,
    SonarCalibration,
    SurfaceMatching,
)
from node_support.parameters import ParameterSet, parameter

# s and rad: stand for a heading that no compass holds; only the walk of the turn rate moves it.
_FOR_EVER = 1e6
_NO_COMPASS = 1e-5
# Deviations by which beams may be later than their stamps, and s of odometry that are worth waiting for.
_LATE = 3.0
_LONGEST_LOOKAHEAD = 1.0
# rad/sqrt(s): the solver needs some freedom of the heading from scan to scan.
_LEAST_WALK = 1e-6


class Estimator(Enum):
    """How scans find their poses."""

    JOINT = "JOINT"
    SCAN_BY_SCAN = "SCAN_BY_SCAN"


@dataclass(frozen=True)
class JointParameters(ParameterSet):
    """What the joint solver needs besides OdometryErrors."""

    estimator: Estimator = parameter(
        Estimator.SCAN_BY_SCAN,
        "JOINT: the newest scans find their poses together, none is rejected; it needs an odometry that is good to "
        "some percent. SCAN_BY_SCAN: each alone, by the matcher",
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
    sonar_delay_deviation: float = parameter(
        0.0, "how far the beams' stamps may be off, all by the same", unit="s", low=0.0, high=5.0, tunable=False
    )
    echo_deviation: float = parameter(
        0.5, "standard deviation of a point square-on to its surface: half an echo's length",
        unit="m", low=0.01, high=10.0, tunable=False,
    )  # fmt: skip
    free_scans: int = parameter(40, "newest scans whose poses may still change", low=2, high=200, tunable=False)

    def solver_parameters(self, errors: OdometryErrors, range_scale_deviation: float) -> MultiViewParameters:
        """Return what these and `errors` mean for the solver."""
        return MultiViewParameters(
            odometry=self._odometry(errors),
            sonar=SonarCalibration(
                range_scale_deviation=range_scale_deviation, sonar_delay_deviation=self.sonar_delay_deviation
            ),
            matching=SurfaceMatching(range_deviation=self.echo_deviation),
            window=SolverWindow(
                free_nodes=self.free_scans, lookahead=min(_LATE * self.sonar_delay_deviation, _LONGEST_LOOKAHEAD)
            ),
        )

    def _odometry(self, errors: OdometryErrors) -> DvlOdometry:
        """Return the walks that errors add up to which last `rate_time`, and `motion_time`."""
        compass = errors.heading_deviation > 0.0
        adding_up = np.sqrt(2.0 * errors.rate_time)
        return DvlOdometry(
            position_walk=max(errors.speed_deviation * adding_up, 1e-3),
            direction=self.odometry_direction,
            direction_deviation=errors.direction_deviation,
            direction_walk=min(errors.direction_deviation * np.sqrt(2.0 / errors.motion_time), 1.0),
            scale=self.odometry_scale,
            scale_deviation=errors.scale_deviation,
            heading_deviation=errors.heading_deviation if compass else _NO_COMPASS,
            heading_time=self.heading_time if compass else _FOR_EVER,
            heading_walk=max(errors.turn_rate_deviation * adding_up, _LEAST_WALK),
        )
