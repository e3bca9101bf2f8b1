"""The interface of odometry models: what is unknown of the motion between nodes, and what ties the nodes together."""

from dataclasses import dataclass
from typing import Dict, Optional, Protocol

import numpy as np

from mlsm_manager.joint_solver.motion.odometry_motion import Motion
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import Layout
from mlsm_manager.scan_matching.prediction import Fading

FIXED_DEVIATION = 1e-4  # m, rad: a pose that is frozen
HELD_DEVIATION = 1e-6  # stands for a deviation of zero
MOTION_STATES = 5


@dataclass(frozen=True)
class Drift:
    """How a motion goes on after a node, as matching.problem.state describes it: the errors of the odometry.

    values: (5,) rate x y [m/s] and yaw [rad/s] in base_link, scale, direction. slopes: (5, width) their derivatives by
    the node's unknowns; a row of zeros is what the model does not estimate.
    """

    values: np.ndarray
    slopes: np.ndarray


class OdometryModel(Protocol):
    """Nodes have `width` unknowns: corrections x, y, yaw of the reported pose, then those of the model.

    The path between two nodes is the model's reference path, turned and scaled by `gain`.
    """

    width: int

    @property
    def calibrated(self) -> Dict[str, int]:
        """Columns that the next run may start from, by name."""

    @property
    def distance_deviation(self) -> float:
        """Relative standard deviation of reported distances; infinite where none are reported."""

    @property
    def position_walk(self) -> float:
        """Random walk of reported positions, m/sqrt(s)."""

    def first_node(self) -> np.ndarray:
        """Return the unknowns (width,) expected at the first node, where the map's origin is the odometry's."""

    def first_deviations(self) -> np.ndarray:
        """Return their standard deviations (width,)."""

    def advanced(self, nodes: np.ndarray, before: Motion, after: Motion) -> np.ndarray:
        """Return the unknowns (n, width) expected at `after` (n), given those at `before` (n)."""

    def add_steps(self, equations: NormalEquations, layout: Layout, nodes: np.ndarray, motion: Motion) -> None:
        """Add what ties the free nodes together. nodes: (n, width), motion: (n), of nodes layout.first to last."""

    def reference(self, motion: Motion) -> np.ndarray:
        """Return the positions (m,) x + i y [m] of the reference path; even where the motion is."""

    def gain(self, nodes: np.ndarray) -> np.ndarray:
        """Return the complex factors (n,) of the reference path after `nodes` (n, width)."""

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        """Return how the motion goes on after a node (width,) at which base_link has `heading` [rad] in map."""

    def fading(self, node: np.ndarray) -> Optional[Fading]:
        """Return how the rates of `drift` change with the time since the node (width,); None where they stay."""


def frozen_deviations(deviations: np.ndarray) -> np.ndarray:
    """Return the deviations (width,) that hold a frozen node; `deviations` are those it was last known with."""
    result = np.maximum(deviations, HELD_DEVIATION)
    result[:3] = FIXED_DEVIATION
    return result
