"""What an odometry of DVL and compass says of the nodes: expected values, residuals and their derivatives."""

from typing import Dict, Optional

import numpy as np

from mlsm_manager.joint_solver.motion.odometry_model import FIXED_DEVIATION, HELD_DEVIATION, MOTION_STATES, Drift
from mlsm_manager.joint_solver.motion.odometry_motion import Motion, as_complex, product
from mlsm_manager.joint_solver.motion.odometry_parameters import DvlOdometry
from mlsm_manager.joint_solver.motion.odometry_terms import add_compass, add_walk, turned
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import YAW, Layout
from mlsm_manager.scan_matching.prediction import Fading

DIRECTION, SCALE = 3, 4
_ROUNDING_VARIANCE = 1e-3  # m^2: of a step, so that steps of no duration do not divide by zero


class DvlFactors:
    """Nodes have columns x, y, yaw, direction [rad] and scale of the odometry: errors that walk slowly."""

    width = 5

    def __init__(self, parameters: DvlOdometry) -> None:
        self._parameters = parameters

    @property
    def calibrated(self) -> Dict[str, int]:
        """See OdometryModel."""
        return {"odometry_scale": SCALE, "odometry_direction": DIRECTION}

    @property
    def distance_deviation(self) -> float:
        """See OdometryModel."""
        return self._parameters.scale_deviation

    @property
    def position_walk(self) -> float:
        """See OdometryModel."""
        return self._parameters.position_walk

    def first_node(self) -> np.ndarray:
        """See OdometryModel."""
        return np.array([0.0, 0.0, 0.0, self._parameters.direction, self._parameters.scale])

    def first_deviations(self) -> np.ndarray:
        """See OdometryModel."""
        own, fixed = self._parameters, FIXED_DEVIATION * 10.0
        walking = np.maximum([own.direction_deviation, own.scale_deviation], HELD_DEVIATION)
        return np.concatenate([[fixed, fixed, own.heading_deviation], walking])

    def reference(self, motion: Motion) -> np.ndarray:
        """See OdometryModel: the reported positions."""
        return motion.positions

    def gain(self, nodes: np.ndarray) -> np.ndarray:
        """See OdometryModel."""
        return (1.0 + nodes[..., SCALE]) * turned(nodes[..., DIRECTION])

    def advanced(self, nodes: np.ndarray, before: Motion, after: Motion) -> np.ndarray:
        """See OdometryModel."""
        step = after.positions - before.positions
        error = product(product(self.gain(nodes), turned(nodes[:, YAW])), step) - step
        result = nodes.copy()
        result[:, 0] += error.real
        result[:, 1] += error.imag
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        """See OdometryModel."""
        values, slopes = np.zeros(MOTION_STATES), np.zeros((MOTION_STATES, self.width))
        values[3:] = node[[SCALE, DIRECTION]]
        slopes[[3, 4], [SCALE, DIRECTION]] = 1.0
        return Drift(values, slopes)

    def fading(self, node: np.ndarray) -> Optional[Fading]:
        """See OdometryModel: there are none, or they are a current."""
        return None

    def add_steps(self, equations: NormalEquations, layout: Layout, nodes: np.ndarray, motion: Motion) -> None:
        """See OdometryModel."""
        starts = layout.node_start(np.arange(layout.first, layout.last))
        self._add_positions(equations, starts, nodes, motion)
        add_compass(equations, starts, nodes, motion.durations, self._parameters)
        walk = self._parameters.direction_walk**2 * motion.durations
        add_walk(equations, starts, self.width, nodes[:, DIRECTION], DIRECTION, walk)
        self._add_scale(equations, starts, nodes, motion.durations)

    def _add_scale(
        self, equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, durations: np.ndarray
    ) -> None:
        add_walk(equations, starts, self.width, nodes[:, SCALE], SCALE, np.zeros(len(starts)))

    def _add_positions(self, equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, motion: Motion) -> None:
        """Add the steps. Noise is one of the reported velocities, so the residuals are those per unit of scale.

        The derivative by the scale contains that; else the fit would shrink the world to make them smaller.
        """
        step, one = np.diff(motion.positions), np.ones(len(starts))
        yaw = (nodes[:-1, YAW] + nodes[1:, YAW]) / 2.0
        turned_step = product(turned(nodes[:-1, DIRECTION] + yaw), step)
        scaled = (1.0 + nodes[:-1, SCALE]) * turned_step
        change = np.diff(as_complex(nodes))
        residual = change - (scaled - step) - self._carried(nodes[:-1], motion.durations)
        weight = 1.0 / (self._parameters.position_walk**2 * motion.durations + _ROUNDING_VARIANCE)
        for axis, part in ((0, np.real), (1, np.imag)):
            places = (self.width + axis, axis, DIRECTION, SCALE, YAW, self.width + YAW, *self._carriers(axis))
            by_angle = -part(1j * scaled)
            slopes = (one, -one, by_angle, -part(turned_step) - part(residual), by_angle / 2.0, by_angle / 2.0)
            slopes += tuple(-motion.durations for _ in self._carriers(axis))
            columns = starts[:, np.newaxis] + np.array(places)
            equations.add(columns, np.column_stack(slopes), part(residual), weight)

    def _carried(self, nodes: np.ndarray, durations: np.ndarray) -> np.ndarray:
        """Return the moves (n,) x + i y [m] in map that the odometry cannot feel."""
        return np.zeros(len(nodes), dtype=np.complex128)

    def _carriers(self, axis: int) -> tuple:
        """Return the columns of the velocities that make those moves along an axis."""
        return ()
