"""How unknowns, and what is not known of them, go on from one node to the next."""

from typing import NamedTuple

import numpy as np

from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.motion.odometry_motion import Motion
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import POSE, Layout


class Transition(NamedTuple):
    """matrix: (width, width) derivatives of the next node by this one. noise: (width, width) covariance."""

    matrix: np.ndarray
    noise: np.ndarray

    @classmethod
    def of(cls, odometry: OdometryModel, nodes: np.ndarray, motion: Motion) -> "Transition":
        """Return that from the first to the second of `nodes` (2, width), where the odometry reported `motion` (2)."""
        layout = Layout(0, 1, odometry.width)
        equations = NormalEquations(layout.size)
        odometry.add_steps(equations, layout, nodes, motion)
        information, _ = equations.dense()
        here, there = slice(0, odometry.width), slice(odometry.width, 2 * odometry.width)
        noise = np.linalg.inv(information[there, there])
        return cls(-noise @ information[there, here], noise)

    def step_covariance(self, covariance: np.ndarray) -> np.ndarray:
        """Return that of the next node (width, width), seen from this one's pose; `covariance` is this node's."""
        known_pose = covariance.copy()
        known_pose[POSE] = known_pose[:, POSE] = 0.0
        return self.matrix @ known_pose @ self.matrix.T + self.noise
