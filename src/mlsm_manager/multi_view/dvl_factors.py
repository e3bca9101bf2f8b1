"""What an odometry of DVL and compass says of the nodes: expected values, residuals and their derivatives.

Another odometry is another class with the same members (`OdometryModel`).
"""

import numpy as np

from mlsm_manager.multi_view.normal_equations import NormalEquations
from mlsm_manager.multi_view.parameters import DvlOdometry
from mlsm_manager.multi_view.state import DIRECTION, POSE_COLUMNS, SCALE, YAW, Layout

_ROUNDING_VARIANCE = 1e-3  # m^2: of a step, so that steps of no duration do not divide by zero
_CONSTANT_DEVIATION = 1e-6  # of what hardly changes from node to node, far below any effect
_HELD_DEVIATION = 1e-6  # stands for a deviation of zero
_FIXED_DEVIATION = 1e-4  # m, rad: a pose that defines the map, or that is frozen


class DvlFactors:
    """Nodes have columns x, y, yaw, direction [rad] and scale of the odometry: errors that walk slowly."""

    width = 5

    def __init__(self, parameters: DvlOdometry) -> None:
        self._parameters = parameters

    def first_node(self) -> np.ndarray:
        """Return the unknowns (width,) expected at the first node, where the map's origin is the odometry's."""
        return np.array([0.0, 0.0, 0.0, self._parameters.direction, self._parameters.scale])

    def first_deviations(self) -> np.ndarray:
        """Return their standard deviations (width,)."""
        own = self._parameters
        fixed = _FIXED_DEVIATION * 10.0
        walking = np.maximum([own.direction_deviation, own.scale_deviation], _HELD_DEVIATION)
        return np.concatenate([[fixed, fixed, own.heading_deviation], walking])

    def frozen_deviations(self, deviations: np.ndarray) -> np.ndarray:
        """Return the deviations (width,) that hold a frozen node; `deviations` are those it was last known with."""
        result = np.maximum(deviations, _HELD_DEVIATION)
        result[:POSE_COLUMNS] = _FIXED_DEVIATION
        return result

    def next_node(self, node: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return the node (width,) expected after `node`, where the odometry went from `before` to `after` (3,)."""
        step = complex(*(after - before)[:2])
        error = _turned(step, node[DIRECTION] + node[YAW], node[SCALE]) - step
        return node + np.array([error.real, error.imag, 0.0, 0.0, 0.0])

    def add_steps(
        self, equations: NormalEquations, layout: Layout, nodes: np.ndarray, times: np.ndarray, poses: np.ndarray
    ) -> None:
        """Add what ties the nodes together. nodes: (n, width), times: (n,) s and poses: (n, 3) T_odom_base of all."""
        starts = layout.node_start(np.arange(layout.first, layout.last))
        durations = np.diff(times)
        self._add_positions(equations, starts, nodes, durations, np.diff(poses[:, :2], axis=0))
        self._add_headings(equations, starts, nodes, durations)
        walks = ((DIRECTION, self._parameters.direction_walk), (SCALE, 0.0))
        for column, walk in walks:
            pair = np.column_stack([starts + self.width + column, starts + column])
            residual = np.diff(nodes[:, column])
            variance = np.maximum(walk**2 * durations, _CONSTANT_DEVIATION**2)
            equations.add(pair, np.tile([1.0, -1.0], (len(starts), 1)), residual, 1.0 / variance)

    def _add_positions(
        self,
        equations: NormalEquations,
        starts: np.ndarray,
        nodes: np.ndarray,
        durations: np.ndarray,
        steps: np.ndarray,
    ) -> None:
        """Add the steps. Noise is one of the reported velocities, so the residuals are those per unit of scale.

        The derivative by the scale contains that; else the fit would shrink the world to make them smaller.
        """
        step = steps[:, 0] + 1j * steps[:, 1]
        yaw = (nodes[:-1, YAW] + nodes[1:, YAW]) / 2.0
        turned = _turned(step, nodes[:-1, DIRECTION] + yaw, 0.0)
        scaled = (1.0 + nodes[:-1, SCALE]) * turned
        change = np.diff(nodes[:, 0]) + 1j * np.diff(nodes[:, 1])
        residual, one = change - (scaled - step), np.ones(len(step))
        weight = 1.0 / (self._parameters.position_walk**2 * durations + _ROUNDING_VARIANCE)
        for axis, part in ((0, np.real), (1, np.imag)):
            places = (self.width + axis, axis, DIRECTION, SCALE, YAW, self.width + YAW)
            by_angle = -part(1j * scaled)
            slopes = (one, -one, by_angle, -part(turned) - part(residual), by_angle / 2.0, by_angle / 2.0)
            columns = starts[:, np.newaxis] + np.array(places)
            equations.add(columns, np.column_stack(slopes), part(residual), weight)

    def _add_headings(
        self, equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, durations: np.ndarray
    ) -> None:
        own = self._parameters
        kept = np.exp(-durations / own.heading_time)
        variance = own.heading_deviation**2 * (1.0 - kept**2) + own.heading_walk**2 * durations
        columns = np.column_stack([starts + self.width + YAW, starts + YAW])
        jacobian = np.column_stack([np.ones(len(starts)), -kept])
        equations.add(columns, jacobian, nodes[1:, YAW] - kept * nodes[:-1, YAW], 1.0 / variance)

    def continued(self, node: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return T_map_base (n, 3) where the odometry is at `after` (n, 3) and the newest node (width,) at `before`."""
        step = (after - before)[..., 0] + 1j * (after - before)[..., 1]
        moved = _turned(step, node[..., DIRECTION] + node[..., YAW], node[..., SCALE])
        x = before[..., 0] + node[..., 0] + moved.real
        y = before[..., 1] + node[..., 1] + moved.imag
        return np.stack([x, y, after[..., 2] + node[..., YAW]], axis=-1)


def _turned(step: np.ndarray, angle: np.ndarray, scale: np.ndarray) -> np.ndarray:
    return (1.0 + scale) * np.exp(1j * angle) * step
