"""Parameters of the joint solver. Every default describes a sensor or a method and gives its reason, none a place."""

from dataclasses import dataclass, field
from typing import Dict, Mapping, Optional, Protocol

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.dvl_factors import DvlFactors
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.motion.odometry_parameters import DvlOdometry
from node_support.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class SonarCalibration(ParameterSet):
    """What is known of the sonar's ranges and stamps before the run."""

    range_scale: float = parameter(0.0, "true range over reported range, minus 1", low=-0.5, high=1.0)
    range_scale_deviation: float = parameter(
        0.02, "its standard deviation: speed of sound between cold fresh and warm salt water", low=0.0, high=0.5
    )
    world_scale_deviation: float = parameter(
        0.0,
        "standard deviation of a scale of ranges and motions together that nothing in the run can tell; it is in the "
        "told covariances only",
        low=0.0,
        high=0.5,
    )
    sonar_delay: float = parameter(0.0, "seconds by which a beam is later than its stamp", unit="s", low=-5.0, high=5.0)
    sonar_delay_deviation: float = parameter(
        1.0, "its standard deviation: clocks set by hand, stamps taken on arrival", unit="s", low=0.0, high=5.0
    )


@dataclass(frozen=True)
class SurfaceMatching(ParameterSet):
    """How points of one scan are compared with the surfaces that other scans heard."""

    range_deviation: float = parameter(
        0.5,
        "standard deviation of a point square-on to its surface: half an echo's length",
        unit="m",
        low=0.01,
        high=10,
    )
    beam_half_width: float = parameter(
        0.06, "angle within which a beam may have heard a point: twice the half-power half width of common heads",
        unit="rad", low=0.0, high=0.5,
    )  # fmt: skip
    cut: float = parameter(2.2, "points farther apart are not compared", unit="m", low=0.1, high=50.0)
    wide_cut: float = parameter(4.0, "the cut that a new scan starts with", unit="m", low=0.1, high=50.0)
    weight: float = parameter(
        0.1,
        "weight of the comparison of two echoes: neighbours share errors, and an echo meets many scans",
        low=1e-4,
        high=1.0,
    )
    min_cosine: float = parameter(
        0.75, "least cosine between two normals, so that both sides of a wall stay apart", low=-1.0, high=0.99
    )
    normal_deviation: float = parameter(
        0.0, "standard deviation of surface normals: what a scan may seem to say of the way along a straight wall",
        unit="rad", low=0.0, high=1.0,
    )  # fmt: skip
    lone_quality: float = parameter(
        0.0, "how certain a strong echo that stands alone is of something small, as a post; 0: none is compared",
        low=0.0, high=1.0,
    )  # fmt: skip
    scan_parts: int = parameter(
        1, "parts into which each turn of the head is cut, each a scan with its own speed: more where speeds change "
        "within a turn", low=1, high=12,
    )  # fmt: skip
    block_scans: int = parameter(
        5, "scans that are searched together: about as far as they see the same", low=1, high=600
    )


@dataclass(frozen=True)
class SolverWindow(ParameterSet):
    """What the live solver keeps free and how far it looks."""

    free_nodes: int = parameter(
        40, "newest nodes that may still move: about ten minutes, in which most places are seen from all sides",
        low=2, high=2400,
    )  # fmt: skip
    max_frozen_blocks: int = parameter(
        16,
        "older blocks that a scan is compared with, the nearest: 80 scans, more than see one place in a tour",
        low=1,
        high=500,
    )
    lookahead: float = parameter(
        1.0, "seconds of odometry after a scan that are waited for, as beams may be later than stamped", unit="s",
        low=0.0, high=5.0,
    )  # fmt: skip
    live_iterations: int = parameter(3, "Gauss-Newton steps per scan", low=1, high=50)
    batch_iterations: int = parameter(25, "Gauss-Newton steps at most for a whole run", low=1, high=500)
    tolerance: float = parameter(
        0.01, "a step below this in the positions' mean square ends the iteration", unit="m", low=1e-9, high=1.0
    )
    settled: float = parameter(
        0.0,
        "so does one of which each node's share is below so many standard deviations, root mean square: where nothing "
        "tells a direction, comparisons with nearest neighbours let the path creep along it for ever",
        low=0.0, high=1.0,
    )  # fmt: skip


class NodeSearch(Protocol):
    """Finds the newest nodes where only echoes tell the motion within a turn. Each scan makes another one."""

    @property
    def variance(self) -> float:
        """How far the places differ that it takes for possible [m^2], in the direction in which they differ most."""

    def followed(self, log: RunLog, parameters: "MultiViewParameters") -> "NodeSearch":
        """Return the search after all scans of `log`, the first of which are those followed before."""

    def placed(self, log: RunLog, nodes: np.ndarray, parameters: "MultiViewParameters", is_told: bool) -> np.ndarray:
        """Return the newest of `nodes` (n, width) at their likeliest places. is_told: the first one's place was."""

    def stored(self) -> Dict[str, np.ndarray]:
        """Return what `resumed` needs besides the log, as arrays by name."""

    def resumed(self, log: RunLog, parameters: "MultiViewParameters", stored: Mapping[str, np.ndarray]) -> "NodeSearch":
        """Return the search after all scans of `log`, which `stored` it then. Raises ValueError, KeyError."""


@dataclass(frozen=True)
class MultiViewParameters:
    """All parameters of a run, in groups. odometry: the model of the vehicle's motion, with its parameters.

    node_search: what finds the nodes of parts of a turn; None where the odometry reports distances.
    """

    odometry: OdometryModel = field(default_factory=lambda: DvlFactors(DvlOdometry()))
    sonar: SonarCalibration = SonarCalibration()
    matching: SurfaceMatching = SurfaceMatching()
    window: SolverWindow = SolverWindow()
    node_search: Optional[NodeSearch] = None
