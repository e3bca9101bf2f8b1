"""Parameters of the joint solver. Every default describes a sensor or a method and gives its reason, none a place."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mlsm_manager.joint_solver.motion_models import OdometryModel
from mlsm_manager.joint_solver.run_log import RunLog
from node_support.parameters import ParameterSet, parameter

# Beams are later than their stamps by so many deviations at most, and s of odometry that are worth waiting for.
_LATE = 3.0
_LONGEST_LOOKAHEAD = 1.0
# Relative deviation of reported distances from which on they hardly hold a path where no surface does; and by how many
# standard deviations per node such a path may still move when it is as good as it gets.
_POOR_DISTANCES = 0.1
_STOP_SIGMA = 0.1


@dataclass(frozen=True)
class JointSolverParameters(ParameterSet):
    """What the joint solver needs to know of a sonar and of how a vehicle goes, by the names in the yaml files."""

    range_scale_deviation: float = parameter(
        0.02, "standard deviation of a common relative error of all ranges: speed of sound between cold fresh and warm "
        "salt water", low=0.0, high=0.5, tunable=False,
    )  # fmt: skip
    sonar_delay_deviation: float = parameter(
        1.0, "how far the beams' stamps may be off, all by the same: many are taken when a beam has arrived", unit="s",
        low=0.0, high=5.0, tunable=False,
    )  # fmt: skip
    plateau_scale_deviation: float = parameter(
        0.03, "least range_scale_deviation where echoes are plateaus", low=0.0, high=0.5, tunable=False,
        expert="plateau_scale_error may be as wrong as it is large, and the speed of sound by 2 %; 0 once calibrated",
    )  # fmt: skip
    plateau_scale_error: float = parameter(
        -0.008, "added to range_scale_error where echoes are plateaus", low=-0.5, high=0.5, tunable=False,
        expert="in a marina plateaus lengthen by 1.6 % of range, so their middle moves outwards; 0 once calibrated",
    )  # fmt: skip
    echo_deviation: float = parameter(
        0.5, "standard deviation of a point square-on to its surface: half an echo's length",
        unit="m", low=0.01, high=10.0, tunable=False,
    )  # fmt: skip
    free_scans: int = parameter(
        40, "newest scans whose poses may still change", low=2, high=200, tunable=False,
        expert="about ten minutes, in which most places are seen from all sides",
    )  # fmt: skip
    normal_deviation: float = parameter(
        0.0, "standard deviation of surface normals; above 0, a straight wall gives no information about motion along "
        "it", unit="rad", low=0.0, high=1.0, tunable=False,
        expert="0 where the odometry reports distances along walls too",
    )  # fmt: skip
    post_confidence: float = parameter(
        0.0, "confidence that an isolated strong echo is a fixed object such as a post; 0: ignore such echoes", low=0.0,
        high=1.0, tunable=False, expert="0 where the odometry reports distances along walls too",
    )  # fmt: skip
    parts_per_turn: int = parameter(
        1, "parts into which each turn of the head is cut, each with its own speed: more where speeds change within a "
        "turn", low=1, high=12, tunable=False, expert="a vehicle with a known odometry needs no speeds within a turn",
    )  # fmt: skip
    scans_per_group: int = parameter(
        5, "scans that are searched together", low=1, high=50, tunable=False, expert="about as many as see the same",
    )  # fmt: skip


def _none_given() -> OdometryModel:
    raise TypeError("SolverParameters without odometry, a model of the vehicle's motion")


@dataclass(frozen=True)
class SolverParameters(JointSolverParameters):
    """All parameters of a run. odometry: the model of the vehicle's motion, with its own parameters.

    A turn of the head is one scan of the run, or `parts_per_turn` of them. node_search: what finds the nodes of these,
    a hovering.ParticleFilter; None where the odometry reports distances.
    """

    range_scale_error: float = parameter(0.0, "true range over reported range, minus 1", low=-0.5, high=1.0)
    sonar_delay: float = parameter(0.0, "seconds by which a beam is later than its stamp", unit="s", low=-5.0, high=5.0)
    beam_half_width: float = 0.06  # rad, within which a beam may have heard a point: twice the half-power half width
    cut: float = 2.2  # m: points farther apart are not compared
    wide_cut: float = 4.0  # m: the cut that a new scan starts with
    weight: float = 0.1  # of the comparison of two echoes: neighbours share errors, and an echo meets many scans
    min_cosine: float = 0.75  # least one between two normals, so that both sides of a wall stay apart
    frozen_scans: int = 80  # older ones that a scan is compared with, the nearest: more than see one place in a tour
    live_iterations: int = 3  # Gauss-Newton steps per scan
    batch_iterations: int = 25  # Gauss-Newton steps at most for a whole run
    tolerance: float = 0.01  # m: a step below this in the positions' mean square ends the iteration
    kept_scans: int = 200  # newest ones of which all is kept; of older ones only what a scan may be compared with
    odometry: OdometryModel = field(default_factory=_none_given)
    node_search: Any = None

    @property
    def free_nodes(self) -> int:
        """Newest nodes that may still move."""
        return self.free_scans * self.parts_per_turn

    @property
    def group_scans(self) -> int:
        """Scans of the run, whole turns or parts of them, that are searched together."""
        return self.scans_per_group * self.parts_per_turn

    @property
    def frozen_groups(self) -> int:
        """Older groups of scans that a scan is compared with."""
        return max(self.frozen_scans // self.scans_per_group, 1)

    @property
    def lookahead(self) -> float:
        """Seconds of odometry after a scan that are waited for, as beams may be later than stamped."""
        return min(_LATE * self.sonar_delay_deviation, _LONGEST_LOOKAHEAD)

    @property
    def stop_sigma(self) -> float:
        """Iteration also ends when nodes move by less than this many standard deviations (root mean square).

        Otherwise a path that nothing constrains in one direction creeps for ever.
        """
        return 0.0 if self.odometry.distance_deviation < _POOR_DISTANCES else _STOP_SIGMA

    def run_mean(self, log: RunLog) -> np.ndarray:
        """Return (2,) a run's unknowns, error of the range scale and delay [s], as expected for echoes like its."""
        of_plateaus = self.plateau_scale_error if log.has_plateaus else 0.0
        return np.array([self.range_scale_error + of_plateaus, self.sonar_delay])

    def run_deviations(self, log: RunLog) -> np.ndarray:
        """Return (2,) their standard deviations for the echoes of a run.

        Where the odometry reports no distances, the sonar's ranges are the only measure of lengths, and nothing in the
        run tells how far they are off: their scale is held, see `world_scale_deviation`.
        """
        return np.array([0.0 if self._only_ranges else self._scale_deviation(log), self.sonar_delay_deviation])

    def world_scale_deviation(self, log: RunLog) -> float:
        """Return the standard deviation of a scale of ranges and motions together that nothing in a run can tell.

        It is in the stated covariances only.
        """
        return self._scale_deviation(log) if self._only_ranges else 0.0

    @property
    def _only_ranges(self) -> bool:
        return bool(np.isinf(self.odometry.distance_deviation))

    def _scale_deviation(self, log: RunLog) -> float:
        of_plateaus = self.plateau_scale_deviation if log.has_plateaus else 0.0
        return max(self.range_scale_deviation, of_plateaus)

    def variances(self, slant: np.ndarray, other_slant: np.ndarray) -> np.ndarray:
        """Return the variances (m,) [m^2] of distances of points from surfaces, with slants (m,) [m] of both.

        A beam that meets a surface aslant may have heard it anywhere in its width: such a point is less certain.
        """
        return self.echo_deviation**2 + self.beam_half_width**2 * (slant**2 + other_slant**2)
