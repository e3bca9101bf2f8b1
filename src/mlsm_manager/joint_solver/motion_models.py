"""Motion models: what is unknown of the motion between nodes, and what the odometry says of it.

Here are the interface, the terms that models share, and the models of odometries that report positions. Those of which
the velocity is unknown are in velocity_models.
"""

from dataclasses import dataclass, fields, replace
from typing import Dict, NamedTuple, Optional, Protocol

import numpy as np

from mlsm_manager.joint_solver.normal_equations import POSE, YAW, Layout, NormalEquations
from mlsm_manager.joint_solver.odometry_log import Motion, as_complex, product, stretched, turned
from mlsm_manager.joint_solver.prior_mixture import PriorMixture
from mlsm_manager.scan_matching.prediction import Fading

FIXED_DEVIATION = 1e-4  # m, rad: a pose that is frozen
HELD_DEVIATION = 1e-6  # stands for a deviation of zero
DRIFT_STATES = 5
DRIFT_SCALE = 3  # row of a drift
DIRECTION, SCALE, CURRENT_X, CURRENT_Y = 3, 4, 5, 6  # columns of the nodes, after x, y and yaw
_CURRENT = slice(5, 7)
_CONSTANT_DEVIATION = 1e-6  # of what hardly changes from node to node, far below any effect
# Of an odometry with which something is wrong: rad, s within which a compass may err otherwise as the vehicle turns,
# relative and 1/sqrt(s): distances are known as a DVL's at first and may be wrong by half two minutes later.
_FREED_HEADING, _FREED_TIME, _FREED_SCALE, _FREED_SCALE_WALK = 0.15, 60.0, 0.09, 0.025
_HELD_SPEED = 0.3  # m/s: the usual one of a small vehicle
_ROUNDING_VARIANCE = 1e-3  # m^2: of a step, so that steps of no duration do not divide by zero


@dataclass(frozen=True)
class Drift:
    """How a motion goes on after a node, as matching.problem.state describes it: the errors of the odometry.

    values: (5,) rate x y [m/s] and yaw [rad/s] in base_link, scale, direction. slopes: (5, width) their derivatives by
    the node's unknowns; a row of zeros is what the model does not estimate.
    """

    values: np.ndarray
    slopes: np.ndarray


class OdometryModel(Protocol):
    """Interface of the models; what they override is described here.

    Nodes have `width` unknowns: corrections x, y, yaw of the reported pose, then those of the model.

    The path between two nodes is the model's reference path, turned and scaled by `gain`.
    """

    width: int

    @property
    def mixture(self) -> Optional[PriorMixture]:
        """Priors of some unknowns of a node, of which one holds for the whole run; None where there is one only."""
        return None

    @property
    def rival(self) -> "Optional[OdometryModel]":
        """The model of another odometry that the vehicle may have; None where its kind was named."""
        return None

    @property
    def freed(self) -> "Optional[OdometryModel]":
        """The model of an odometry with which something is wrong; None where nothing is known that could be."""
        return None

    @property
    def compass(self) -> "Optional[Compass]":
        """How wrong the reported heading may be; None where none is reported."""
        return None

    @property
    def calibrated(self) -> Dict[str, int]:
        """Columns that the next run may start from, by name."""
        return {}

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
        return None


def frozen_deviations(deviations: np.ndarray) -> np.ndarray:
    """Return the deviations (width,) that hold a frozen node; `deviations` are those it was last known with."""
    result = np.maximum(deviations, HELD_DEVIATION)
    result[:3] = FIXED_DEVIATION
    return result


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


class Change(NamedTuple):
    """How an unknown goes on from each of n - 1 nodes: which share of it is kept, and the variance of what is added."""

    kept: np.ndarray
    variance: np.ndarray


Changes = Dict[int, Change]
"""Of unknowns, by their columns of a node."""


@dataclass(frozen=True)
class Compass:
    """How wrong the reported heading may be: standard deviations [rad], how long an error lasts [s].

    It errs differently where iron is near: for some minutes at the speed of a small vehicle. heading_walk: rad/sqrt(s),
    white noise of the turn rate besides.
    """

    heading_deviation: float
    heading_correlation_time: float
    heading_walk: float

    def change(self, durations: np.ndarray) -> Change:
        """Return how the correction of the reported heading changes: an error that lasts, and a walk."""
        kept = np.exp(-durations / self.heading_correlation_time)
        return Change(kept, self.heading_deviation**2 * (1.0 - kept**2) + self.heading_walk**2 * durations)

    @property
    def freed(self) -> "Compass":
        """A compass with which something is wrong: iron beside it, or a gyro that drifts."""
        return replace(self, heading_deviation=_FREED_HEADING, heading_correlation_time=_FREED_TIME)


@dataclass(frozen=True)
class DvlOdometry:
    """How wrong an odometry of DVL and compass may be.

    position_walk: m/sqrt(s), integrated noise of its velocities. direction: rad from reported to true motion, as known
    beforehand, direction_walk: rad/sqrt(s). scale: true over reported distance minus 1, as known beforehand.
    """

    compass: Compass
    position_walk: float
    direction: float
    direction_deviation: float
    direction_walk: float
    scale: float
    scale_deviation: float


@dataclass(frozen=True)
class ThrusterOdometry(DvlOdometry):
    """How wrong a motion may be that was reckoned from the commands of the thrusters.

    The speed that a command means changes with the battery and with what hangs on the vehicle; a current carries it
    along. scale_walk: 1/sqrt(s). current_deviation: m/s in each direction. current_walk: m/s/sqrt(s).
    """

    scale_walk: float
    current_deviation: float
    current_walk: float


class DvlFactors(OdometryModel):
    """Nodes have columns x, y, yaw, direction [rad] and scale of the odometry: errors that walk slowly."""

    width = 5

    def __init__(self, parameters: DvlOdometry) -> None:
        self._parameters = parameters

    @property
    def compass(self) -> Optional[Compass]:
        return self._parameters.compass

    @property
    def freed(self) -> "ThrusterFactors":
        own = {field.name: getattr(self._parameters, field.name) for field in fields(DvlOdometry)}
        still = {"scale_walk": 0.0, "current_deviation": HELD_DEVIATION, "current_walk": 0.0}
        return ThrusterFactors(ThrusterOdometry(**own, **still)).freed

    @property
    def calibrated(self) -> Dict[str, int]:
        return {"odometry_scale": SCALE, "odometry_direction": DIRECTION}

    @property
    def distance_deviation(self) -> float:
        return self._parameters.scale_deviation

    @property
    def position_walk(self) -> float:
        return self._parameters.position_walk

    def first_node(self) -> np.ndarray:
        return np.array([0.0, 0.0, 0.0, self._parameters.direction, self._parameters.scale])

    def first_deviations(self) -> np.ndarray:
        own, fixed = self._parameters, FIXED_DEVIATION * 10.0
        walking = np.maximum([own.direction_deviation, own.scale_deviation], HELD_DEVIATION)
        return np.concatenate([[fixed, fixed, own.compass.heading_deviation], walking])

    def reference(self, motion: Motion) -> np.ndarray:
        """The reported positions."""
        return motion.positions

    def gain(self, nodes: np.ndarray) -> np.ndarray:
        return (1.0 + nodes[..., SCALE]) * turned(nodes[..., DIRECTION])

    def advanced(self, nodes: np.ndarray, before: Motion, after: Motion) -> np.ndarray:
        step = after.positions - before.positions
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

    def add_steps(self, equations: NormalEquations, layout: Layout, nodes: np.ndarray, motion: Motion) -> None:
        starts = layout.node_start(np.arange(layout.first, layout.last))
        durations = motion.durations
        self._add_positions(equations, starts, nodes, motion)
        add_changes(equations, starts, nodes, self._changes(durations))

    def _changes(self, durations: np.ndarray) -> Changes:
        """Return how the errors of the odometry change from node to node."""
        own = self._parameters
        return {
            YAW: own.compass.change(durations),
            DIRECTION: walk(own.direction_walk, durations),
            SCALE: walk(0.0, durations),
        }

    def _add_positions(self, equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, motion: Motion) -> None:
        """Add the steps. While positions are held nobody knows how far the vehicle goes.

        Noise is one of the reported velocities, so the residuals are those per unit of scale. The derivative by the
        scale contains that; else the fit would shrink the world to make them smaller.
        """
        step, durations = np.diff(motion.positions), motion.durations
        one = np.ones(len(starts))
        yaw = (nodes[:-1, YAW] + nodes[1:, YAW]) / 2.0
        turned_step = product(turned(nodes[:-1, DIRECTION] + yaw), step)
        scaled = (1.0 + nodes[:-1, SCALE]) * turned_step
        change = np.diff(as_complex(nodes))
        residual = change - (scaled - step) - self._carried(nodes[:-1], durations)
        unknown = (_HELD_SPEED * np.diff(motion.held)) ** 2
        weight = 1.0 / (self._parameters.position_walk**2 * durations + unknown + _ROUNDING_VARIANCE)
        for axis, part in ((0, np.real), (1, np.imag)):
            places = (self.width + axis, axis, DIRECTION, SCALE, YAW, self.width + YAW, *self._carriers(axis))
            by_angle = -part(1j * scaled)
            slopes = (one, -one, by_angle, -part(turned_step) - part(residual), by_angle / 2.0, by_angle / 2.0)
            slopes += tuple(-durations for _ in self._carriers(axis))
            columns = starts[:, np.newaxis] + np.array(places)
            equations.add(columns, np.column_stack(slopes), part(residual), weight)

    def _carried(self, nodes: np.ndarray, durations: np.ndarray) -> np.ndarray:
        """Return the moves (n,) x + i y [m] in map that the odometry cannot feel."""
        return np.zeros(len(nodes), dtype=np.complex128)

    def _carriers(self, axis: int) -> tuple:
        """Return the columns of the velocities that make those moves along an axis."""
        return ()


class ThrusterFactors(DvlFactors):
    """Nodes have columns x, y, yaw, direction [rad] and scale as DvlFactors, and the current x, y in map [m/s]."""

    width = 7

    def __init__(self, parameters: ThrusterOdometry) -> None:
        super().__init__(parameters)
        self._own = parameters

    @property
    def freed(self) -> "ThrusterFactors":
        scale = {"scale_deviation": _FREED_SCALE, "scale_walk": _FREED_SCALE_WALK}
        return ThrusterFactors(replace(self._own, compass=self._own.compass.freed, **scale))

    def first_node(self) -> np.ndarray:
        return np.append(super().first_node(), [0.0, 0.0])

    def first_deviations(self) -> np.ndarray:
        current = max(self._own.current_deviation, HELD_DEVIATION)
        return np.append(super().first_deviations(), [current, current])

    def advanced(self, nodes: np.ndarray, before: Motion, after: Motion) -> np.ndarray:
        result = super().advanced(nodes, before, after)
        result[:, :2] += nodes[:, _CURRENT] * (after.times - before.times)[:, np.newaxis]
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        known = super().drift(node, heading)
        values, slopes = known.values, known.slopes
        to_base = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        values[:2] = to_base @ node[_CURRENT]
        slopes[:2, _CURRENT] = to_base
        return Drift(values, slopes)

    def _changes(self, durations: np.ndarray) -> Changes:
        own, current = self._own, walk(self._own.current_walk, durations)
        changed = {SCALE: walk(own.scale_walk, durations), CURRENT_X: current, CURRENT_Y: current}
        return {**super()._changes(durations), **changed}

    def _carried(self, nodes: np.ndarray, durations: np.ndarray) -> np.ndarray:
        return as_complex(nodes[:, _CURRENT]) * durations

    def _carriers(self, axis: int) -> tuple:
        return (CURRENT_X + axis,)


def walk(deviation: float, durations: np.ndarray) -> Change:
    """Return the change of an unknown that walks by `deviation` [1/sqrt(s)]."""
    return Change(np.ones(len(durations)), deviation**2 * durations)


def add_changes(equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, changes: Changes) -> None:
    """Add how unknowns change; starts: (n - 1,) columns of all nodes but the last. nodes: (n, width)."""
    columns, values = np.array(list(changes))[:, np.newaxis], nodes[:, list(changes)].T
    kept, variances = (np.stack(each) for each in zip(*changes.values()))
    places = np.stack([starts + nodes.shape[1] + columns, starts + columns], axis=-1)
    jacobian = np.stack([np.ones_like(kept), -kept], axis=-1)
    weight = 1.0 / np.maximum(variances, _CONSTANT_DEVIATION**2)
    residual = values[:, 1:] - kept * values[:, :-1]
    equations.add(places.reshape(-1, 2), jacobian.reshape(-1, 2), residual.ravel(), weight.ravel())
