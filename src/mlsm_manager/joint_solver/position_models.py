"""Motion models of odometries that report positions: of a DVL, of the thrusters' commands, or of either."""

from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Dict, Iterator, List

import numpy as np

from mlsm_manager.joint_solver.motion_models import (
    CURRENT_X,
    CURRENT_Y,
    DIRECTION,
    DRIFT_STATES,
    FIXED_DEVIATION,
    SCALE,
    Compass,
    Drift,
    OdometryModel,
    changes_of,
    step_columns,
)
from mlsm_manager.joint_solver.normal_equations import HELD_DEVIATION, YAW, Residuals
from mlsm_manager.joint_solver.odometry_log import Motion, product, stretched
from mlsm_manager.joint_solver.prior_mixture import PriorComponent, PriorMixture

_CURRENT = slice(5, 7)
# Of an odometry with which something is wrong, relative and 1/sqrt(s): distances are known as a DVL's at first and may
# be wrong by half two minutes later.
_FREED_SCALE, _FREED_SCALE_WALK = 0.09, 0.025
_HELD_SPEED = 0.3  # m/s: the usual one of a small vehicle
_ROUNDING_VARIANCE = 1e-3  # m^2: of a step, so that steps of no duration do not divide by zero


@dataclass(frozen=True)
class PositionOdometry:
    """How wrong an odometry may be of DVL and compass, or one that was reckoned from the commands of the thrusters.

    position_walk: m/sqrt(s), integrated noise of its velocities. direction: rad from reported to true motion, as known
    beforehand, direction_walk: rad/sqrt(s). scale: true over reported distance minus 1, as known beforehand.

    The speed that a command means changes with the battery and with what hangs on the vehicle; a current carries it
    along. scale_walk: 1/sqrt(s). current_deviation: m/s in each direction. current_walk: m/s/sqrt(s).
    """

    compass: Compass
    position_walk: float
    direction: float
    direction_deviation: float
    direction_walk: float
    scale: float
    scale_deviation: float
    scale_walk: float = 0.0
    current_deviation: float = HELD_DEVIATION
    current_walk: float = 0.0


class DvlFactors(OdometryModel):
    """Nodes have columns x, y, yaw, direction [rad] and scale of the odometry: errors that walk slowly.

    The reference path is that of the reported positions.
    """

    width = 5
    reference = attrgetter("positions")
    _carriers = 0
    """1 where the velocities after the scale carry the vehicle along, which the odometry cannot feel."""

    def __init__(self, parameters: PositionOdometry) -> None:
        self._parameters, self.compass = parameters, parameters.compass
        self.distance_deviation, self.position_walk = parameters.scale_deviation, parameters.position_walk
        self._walks = {DIRECTION: parameters.direction_walk, SCALE: 0.0}

    @property
    def freed(self) -> "ThrusterFactors":
        return ThrusterFactors(self._parameters).freed

    @property
    def calibrated(self) -> Dict[str, int]:
        return {"odometry_scale": SCALE, "odometry_direction": DIRECTION}

    def first_node(self) -> np.ndarray:
        return np.array([0.0, 0.0, 0.0, self._parameters.direction, self._parameters.scale])

    def first_deviations(self) -> np.ndarray:
        own, fixed = self._parameters, FIXED_DEVIATION * 10.0
        walking = np.maximum([own.direction_deviation, own.scale_deviation], HELD_DEVIATION)
        return np.concatenate([[fixed, fixed, own.compass.heading_deviation], walking])

    def gain(self, nodes: np.ndarray) -> np.ndarray:
        return (1.0 + nodes[..., SCALE]) * np.exp(1j * nodes[..., DIRECTION])

    def advanced(self, nodes: np.ndarray, motion: Motion) -> np.ndarray:
        step = np.diff(motion.positions)
        error = stretched(step, self.gain(nodes), nodes[:, YAW]) - step
        result = nodes.copy()
        result[:, 0] += error.real
        result[:, 1] += error.imag
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        values, slopes = np.zeros(DRIFT_STATES), np.zeros((DRIFT_STATES, self.width))
        values[3:] = node[[SCALE, DIRECTION]]
        slopes[[3, 4], [SCALE, DIRECTION]] = 1.0
        return Drift(values, slopes)

    def steps(self, nodes: np.ndarray, motion: Motion) -> List[Residuals]:
        changes = changes_of(nodes, motion.times, self._walks, {}, self.compass)
        return [*self._positions(nodes, motion), changes]

    def _positions(self, nodes: np.ndarray, motion: Motion) -> Iterator[Residuals]:
        """Yield the steps in x and in y. While positions are held nobody knows how far the vehicle goes.

        Noise is one of the reported velocities, so the residuals are those per unit of scale. The derivative by the
        scale contains that; else the fit would shrink the world to make them smaller.
        """
        step, before, durations = np.diff(motion.positions), nodes[:-1], np.diff(motion.times)
        one, starts = np.ones(len(step)), step_columns(nodes, 0)
        yaw = (before[:, YAW] + nodes[1:, YAW]) / 2.0
        turned_step = product(np.exp(1j * (before[:, DIRECTION] + yaw)), step)
        scaled = (1.0 + before[:, SCALE]) * turned_step
        unknown = (_HELD_SPEED * np.diff(motion.held)) ** 2
        weight = 1.0 / (self.position_walk**2 * durations + unknown + _ROUNDING_VARIANCE)
        for axis, part in ((0, np.real), (1, np.imag)):
            carriers = [CURRENT_X + axis] * self._carriers
            carried = before[:, carriers].sum(axis=1) * durations
            residual = np.diff(nodes[:, axis]) - part(scaled - step) - carried
            by_angle = -part(1j * scaled)
            slopes = (one, -one, by_angle, -part(turned_step) - residual, by_angle / 2.0, by_angle / 2.0)
            slopes += (-durations,) * self._carriers
            columns = np.array([self.width + axis, axis, DIRECTION, SCALE, YAW, self.width + YAW, *carriers])
            yield Residuals(starts + columns, np.column_stack(slopes), residual, weight)


class ThrusterFactors(DvlFactors):
    """Nodes have columns x, y, yaw, direction [rad] and scale as DvlFactors, and the current x, y in map [m/s]."""

    width = 7
    _carriers = 1

    def __init__(self, parameters: PositionOdometry) -> None:
        super().__init__(parameters)
        current = parameters.current_walk
        self._walks.update({SCALE: parameters.scale_walk, CURRENT_X: current, CURRENT_Y: current})

    @property
    def freed(self) -> "ThrusterFactors":
        scale = {"scale_deviation": _FREED_SCALE, "scale_walk": _FREED_SCALE_WALK}
        return ThrusterFactors(replace(self._parameters, compass=self.compass.freed, **scale))

    def first_node(self) -> np.ndarray:
        return np.append(super().first_node(), [0.0, 0.0])

    def first_deviations(self) -> np.ndarray:
        current = max(self._parameters.current_deviation, HELD_DEVIATION)
        return np.append(super().first_deviations(), [current, current])

    def advanced(self, nodes: np.ndarray, motion: Motion) -> np.ndarray:
        result = super().advanced(nodes, motion)
        result[:, :2] += nodes[:, _CURRENT] * np.diff(motion.times)[:, np.newaxis]
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        known = super().drift(node, heading)
        values, slopes = known.values, known.slopes
        to_base = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        values[:2] = to_base @ node[_CURRENT]
        slopes[:2, _CURRENT] = to_base
        return Drift(values, slopes)


_DVL_SHARE = 0.8  # probability that an unnamed odometry is a DVL's: data sheets are usually right
_SCALE_DEVIATION = 0.3  # if it is not: the speed at a thrust is known to a third
_CURRENT_DEVIATION, _NO_CURRENT = 0.1, 0.003  # m/s; the second stands for none
_CURRENT_TOLD = 0.05  # m/s, half of a slow current: deviation from which on the echoes are asked whether there is one
# 1/sqrt(s), m/s/sqrt(s): how fast what the echoes told is forgotten.
_SCALE_WALK, _CURRENT_WALK = 0.1 / np.sqrt(600.0), 0.002


class UnsureFactors(ThrusterFactors):
    """As ThrusterFactors, of an odometry that may be a DVL's, of which `rival` is the model.

    Scale and current do not walk within the window of the live solver, nor within a run that is refined.
    """

    def __init__(self, dvl: PositionOdometry) -> None:
        super().__init__(replace(dvl, scale_deviation=_SCALE_DEVIATION, current_deviation=_CURRENT_DEVIATION))
        self.rival = DvlFactors(dvl)
        still, flowing = [_NO_CURRENT, _NO_CURRENT], [_CURRENT_DEVIATION, _CURRENT_DEVIATION]
        share = (1.0 - _DVL_SHARE) / 2.0
        components = (
            PriorComponent("THRUSTERS", share, np.array([_SCALE_DEVIATION, *still])),
            PriorComponent("THRUSTERS in a current", share, np.array([_SCALE_DEVIATION, *flowing])),
        )
        self.mixture = PriorMixture(
            columns=(SCALE, CURRENT_X, CURRENT_Y),
            mean=np.array([dvl.scale, 0.0, 0.0]),
            widest=components[-1].deviations,
            told=np.array([np.inf, _CURRENT_TOLD, _CURRENT_TOLD]),
            walks=np.array([_SCALE_WALK, _CURRENT_WALK, _CURRENT_WALK]),
            components=components,
            rival=PriorComponent("DVL", _DVL_SHARE, np.array([dvl.scale_deviation, *still])),
        )
