"""What is known of the nodes where nothing is reported: velocity and turn rate are unknown."""

from dataclasses import replace

import numpy as np

from mlsm_manager.joint_solver.motion.heading_factors import HeadingFactors
from mlsm_manager.joint_solver.motion.odometry_model import FIXED_DEVIATION, Drift
from mlsm_manager.joint_solver.motion.odometry_motion import Motion
from mlsm_manager.joint_solver.motion.odometry_parameters import UnaidedOdometry
from mlsm_manager.joint_solver.motion.odometry_terms import add_forgetting
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import YAW
from mlsm_manager.scan_matching.prediction import Fading

TURN_RATE = 6


class UnaidedFactors(HeadingFactors):
    """Nodes have the columns of HeadingFactors, and the turn rate [rad/s], which forgets itself."""

    width = 7

    def __init__(self, parameters: UnaidedOdometry) -> None:
        super().__init__(parameters)
        self._own = parameters

    def first_deviations(self) -> np.ndarray:
        """See OdometryModel: the first heading defines the map."""
        result = np.append(super().first_deviations(), self._own.turn_rate_deviation)
        result[YAW] = FIXED_DEVIATION * 10.0
        return result

    def advanced(self, nodes: np.ndarray, before: Motion, after: Motion) -> np.ndarray:
        """See OdometryModel."""
        durations = after.times - before.times
        rate = nodes[:, TURN_RATE]
        half = nodes.copy()
        later = np.exp(-durations / self._own.turn_rate_time) * rate
        turn = (rate + later) / 2.0 * durations
        half[:, YAW] += turn / 2.0
        result = super().advanced(half, before, after)
        result[:, YAW] += turn / 2.0
        result[:, TURN_RATE] = later
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        """See OdometryModel."""
        known = super().drift(node, heading)
        values, slopes = known.values, known.slopes
        values[2], slopes[2, TURN_RATE] = node[TURN_RATE], 1.0
        return Drift(values, slopes)

    def fading(self, node: np.ndarray) -> Fading:
        """See OdometryModel."""
        known = super().fading(node)
        return replace(known, times=np.append(known.times[:2], self._own.turn_rate_time))

    def _add_yaw(
        self, equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, durations: np.ndarray
    ) -> None:
        own = self._own
        kept = np.exp(-durations / own.turn_rate_time)
        variance = own.turn_rate_deviation**2 * (1.0 - kept**2)
        add_forgetting(equations, starts, self.width, nodes[:, TURN_RATE], TURN_RATE, kept, variance)
        places = np.array([self.width + YAW, YAW, self.width + TURN_RATE, TURN_RATE])
        one, half = np.ones(len(starts)), durations / 2.0
        residual = np.diff(nodes[:, YAW]) - half * (nodes[1:, TURN_RATE] + nodes[:-1, TURN_RATE])
        short = own.turn_rate_deviation**2 * np.minimum(durations**3 / (6.0 * own.turn_rate_time), durations**2)
        weight = 1.0 / (short + own.heading_walk**2 * durations)
        jacobian = np.column_stack([one, -one, -half, -half])
        equations.add(starts[:, np.newaxis] + places, jacobian, residual, weight)
