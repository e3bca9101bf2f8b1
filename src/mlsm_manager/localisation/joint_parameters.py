"""Parameters of the joint solver in a vehicle's words: what is known of its odometry, its compass and its sonar."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from mlsm_manager.joint_solver.parameters import MultiViewParameters, SolverWindow, SonarCalibration, SurfaceMatching
from mlsm_manager.localisation.odometry_profiles import OdometryChoice, OdometryKind
from mlsm_manager.scan_matching.prediction import OdometryErrors
from node_support.parameters import ParameterError, parameter

# Deviations by which beams may be later than their stamps, and s of odometry that are worth waiting for.
_LATE = 3.0
_LONGEST_LOOKAHEAD = 1.0
# Older scans that a scan is compared with: more than see one place in a tour.
_FROZEN_SCANS = 80
# Relative deviation of reported distances from which on they hardly hold a path where no surface does; and by how many
# deviations per node such a path may still move when it is as good as it gets.
_POOR_DISTANCES = 0.1
_SETTLED = 0.1


class EstimatorName(Enum):
    """How scans find their poses."""

    JOINT = "JOINT"
    SCAN_BY_SCAN = "SCAN_BY_SCAN"
    THESIS = "THESIS"


@dataclass(frozen=True)
class JointParameters(OdometryChoice):
    """What the joint solver needs besides OdometryErrors."""

    estimator: EstimatorName = parameter(
        EstimatorName.SCAN_BY_SCAN,
        "JOINT: the newest scans find their poses together, none is rejected; `odometry` says what "
        "the motion is known from. SCAN_BY_SCAN: each alone, against the map of those before. THESIS: the same by the "
        "matcher of the thesis, to compare with",
        tunable=False,
    )  # fmt: skip
    sonar_delay_deviation: float = parameter(
        0.0, "how far the beams' stamps may be off, all by the same", unit="s", low=0.0, high=5.0, tunable=False
    )
    echo_deviation: float = parameter(
        0.5, "standard deviation of a point square-on to its surface: half an echo's length",
        unit="m", low=0.01, high=10.0, tunable=False,
    )  # fmt: skip
    free_scans: int = parameter(40, "newest scans whose poses may still change", low=2, high=200, tunable=False)
    normal_deviation: float = parameter(
        0.0, "standard deviation of the surfaces' normals; above 0, straight walls tell nothing of the way along them",
        unit="rad", low=0.0, high=1.0, tunable=False,
    )  # fmt: skip
    lone_quality: float = parameter(
        0.0, "how certain a strong echo that stands alone is of something small that stays, as a post; above 0, such "
        "echoes are compared with each other", low=0.0, high=1.0, tunable=False,
    )  # fmt: skip
    scan_parts: int = parameter(
        1, "parts into which each turn of the head is cut, each with its own speed: more where speeds change within a "
        "turn", low=1, high=12, tunable=False,
    )  # fmt: skip
    block_scans: int = parameter(
        5, "scans that are searched together: about as far as they see the same", low=1, high=50, tunable=False
    )

    def check(self) -> None:
        """Refuse parts of turns whose headings nobody reports."""
        if self.odometry is OdometryKind.NONE and self.scan_parts > 1:
            raise ParameterError(
                f"scan_parts = {self.scan_parts}: must be 1 with odometry = NONE, because parts of turns are placed "
                "by particles that need a heading"
            )

    def longest_turn(self, errors: OdometryErrors) -> float:
        """Return how long a turn of the head may take [s]: in each part of it the vehicle is at about one speed."""
        measured = not np.isinf(self.odometry_model(errors).distance_deviation)
        alone = self.estimator is not EstimatorName.JOINT
        return np.inf if measured or alone else errors.rate_time * self.scan_parts

    def solver_parameters(self, errors: OdometryErrors, range_scale_deviation: float) -> MultiViewParameters:
        """Return what these and `errors` mean for the solver.

        Where the odometry reports no distances, the sonar's ranges are the only measure of lengths, and nothing in the
        run tells how far they are off: their scale is held, and its deviation told with the positions.
        """
        odometry = self.odometry_model(errors)
        of_ranges, of_world = range_scale_deviation, 0.0
        if np.isinf(odometry.distance_deviation):
            of_ranges, of_world = of_world, of_ranges
        return MultiViewParameters(
            odometry=odometry,
            sonar=SonarCalibration(
                range_scale_deviation=of_ranges,
                world_scale_deviation=of_world,
                sonar_delay_deviation=self.sonar_delay_deviation,
            ),
            matching=self._matching(),
            window=self._window(odometry.distance_deviation),
            node_search=self.node_search(self.scan_parts),
        )

    def _matching(self) -> SurfaceMatching:
        return SurfaceMatching(
            range_deviation=self.echo_deviation,
            normal_deviation=self.normal_deviation,
            lone_quality=self.lone_quality,
            scan_parts=self.scan_parts,
            block_scans=self.block_scans * self.scan_parts,
        )

    def _window(self, distance_deviation: float) -> SolverWindow:
        """distance_deviation: relative, of the distances that the odometry reports; infinity where it reports none."""
        return SolverWindow(
            free_nodes=self.free_scans * self.scan_parts,
            settled=0.0 if distance_deviation < _POOR_DISTANCES else _SETTLED,
            lookahead=min(_LATE * self.sonar_delay_deviation, _LONGEST_LOOKAHEAD),
            max_frozen_blocks=max(_FROZEN_SCANS // self.block_scans, 1),
        )
