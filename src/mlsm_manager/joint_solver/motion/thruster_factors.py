"""What a motion reckoned from thruster commands says of the nodes: its scale walks, and a current carries it along."""

import numpy as np

from mlsm_manager.joint_solver.motion.dvl_factors import SCALE, DvlFactors
from mlsm_manager.joint_solver.motion.odometry_model import HELD_DEVIATION, Drift
from mlsm_manager.joint_solver.motion.odometry_motion import Motion, as_complex
from mlsm_manager.joint_solver.motion.odometry_parameters import ThrusterOdometry
from mlsm_manager.joint_solver.motion.odometry_terms import add_walk
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import Layout

CURRENT_X, CURRENT_Y = 5, 6
_CURRENT = slice(5, 7)


class ThrusterFactors(DvlFactors):
    """Nodes have columns x, y, yaw, direction [rad] and scale as DvlFactors, and the current x, y in map [m/s]."""

    width = 7

    def __init__(self, parameters: ThrusterOdometry) -> None:
        super().__init__(parameters)
        self._own = parameters

    def first_node(self) -> np.ndarray:
        """See OdometryModel."""
        return np.append(super().first_node(), [0.0, 0.0])

    def first_deviations(self) -> np.ndarray:
        """See OdometryModel."""
        current = max(self._own.current_deviation, HELD_DEVIATION)
        return np.append(super().first_deviations(), [current, current])

    def advanced(self, nodes: np.ndarray, before: Motion, after: Motion) -> np.ndarray:
        """See OdometryModel."""
        result = super().advanced(nodes, before, after)
        result[:, :2] += nodes[:, _CURRENT] * (after.times - before.times)[:, np.newaxis]
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        """See OdometryModel."""
        known = super().drift(node, heading)
        values, slopes = known.values, known.slopes
        to_base = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        values[:2] = to_base @ node[_CURRENT]
        slopes[:2, _CURRENT] = to_base
        return Drift(values, slopes)

    def add_steps(self, equations: NormalEquations, layout: Layout, nodes: np.ndarray, motion: Motion) -> None:
        """See OdometryModel."""
        super().add_steps(equations, layout, nodes, motion)
        starts = layout.node_start(np.arange(layout.first, layout.last))
        walk = self._own.current_walk**2 * motion.durations
        for column in (CURRENT_X, CURRENT_Y):
            add_walk(equations, starts, self.width, nodes[:, column], column, walk)

    def _add_scale(
        self, equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, durations: np.ndarray
    ) -> None:
        walk = self._own.scale_walk**2 * durations
        add_walk(equations, starts, self.width, nodes[:, SCALE], SCALE, walk)

    def _carried(self, nodes: np.ndarray, durations: np.ndarray) -> np.ndarray:
        return as_complex(nodes[:, _CURRENT]) * durations

    def _carriers(self, axis: int) -> tuple:
        return (CURRENT_X + axis,)
