"""Parameters of the joint solver in a vehicle's words: what is known of its odometry, its compass and its sonar."""

from dataclasses import dataclass, fields
from enum import Enum

import numpy as np

from mlsm_manager.joint_solver.parameters import JointSolverParameters, SolverParameters
from mlsm_manager.localisation.odometry_profiles import OdometryChoice, OdometryKind
from mlsm_manager.scan_matching.prediction import OdometryErrors
from node_support.parameters import ParameterError, parameter


class EstimatorName(Enum):
    """How scans find their poses."""

    JOINT = "JOINT"
    SCAN_BY_SCAN = "SCAN_BY_SCAN"
    THESIS = "THESIS"


@dataclass(frozen=True)
class JointParameters(OdometryChoice, JointSolverParameters):
    """What the joint solver needs besides OdometryErrors."""

    estimator: EstimatorName = parameter(
        EstimatorName.SCAN_BY_SCAN,
        "JOINT: the newest scans find their poses together, none is rejected; `odometry` says what "
        "the motion is known from. SCAN_BY_SCAN: each alone, against the map of those before. THESIS: the same by the "
        "matcher of the thesis, to compare with", tunable=False,
    )  # fmt: skip

    def check(self) -> None:
        """Refuse parts of turns whose headings nobody reports."""
        if self.odometry is OdometryKind.NONE and self.parts_per_turn > 1:
            raise ParameterError(
                f"parts_per_turn = {self.parts_per_turn}: must be 1 with odometry = NONE, because parts of turns are "
                "placed by particles that need a heading"
            )

    def longest_turn(self, errors: OdometryErrors) -> float:
        """Return how long a turn of the head may take [s]: in each part of it the vehicle is at about one speed."""
        measured = not np.isinf(self.odometry_model(errors).distance_deviation)
        alone = self.estimator is not EstimatorName.JOINT
        return np.inf if measured or alone else errors.rate_time * self.parts_per_turn

    def solver_parameters(self, errors: OdometryErrors, range_scale_deviation: float) -> SolverParameters:
        """Return what these and `errors` mean for the solver. range_scale_deviation: relative, of the ranges."""
        own = {field.name: getattr(self, field.name) for field in fields(JointSolverParameters)}
        odometry = self.odometry_model(errors)
        return SolverParameters(
            **own,
            range_scale_deviation=range_scale_deviation,
            odometry=odometry,
            node_search=self.node_search(self.parts_per_turn),
        )
