"""Motion models: what is unknown of the motion between nodes, and what the odometry says of it.

Here are the interface and the terms that models share. position_models has those of odometries that report positions,
velocity_models those of which the velocity is unknown.
"""

from dataclasses import dataclass, replace
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Protocol, Tuple

import numpy as np

from mlsm_manager.joint_solver.normal_equations import YAW, Residuals
from mlsm_manager.joint_solver.odometry_log import Motion
from mlsm_manager.joint_solver.prior_mixture import PriorMixture
from mlsm_manager.scan_matching.scan import Fading

FIXED_DEVIATION = 1e-4  # m, rad: a pose that is frozen
DRIFT_STATES = 5
DRIFT_SCALE = 3  # row of a drift
DIRECTION, SCALE, CURRENT_X, CURRENT_Y = 3, 4, 5, 6  # columns of the nodes, after x, y and yaw
_CONSTANT_DEVIATION = 1e-6  # of what hardly changes from node to node, far below any effect
# Of an odometry with which something is wrong: rad, s within which a compass may err otherwise as the vehicle turns.
_FREED_HEADING, _FREED_TIME = 0.15, 60.0
_TURN_WALK = 0.22  # rad/sqrt(s): by turns of 0.05 rad/s that last 10 s, of which a compass that is stuck tells nothing


@dataclass(frozen=True)
class Drift:
    """How a motion goes on after a node: the errors of the odometry, see scan_matching.scan_path.

    values: (5,) rate x y [m/s] and yaw [rad/s] in base_link, scale, direction. slopes: (5, width) their derivatives by
    the node's unknowns; zeros of what the model does not estimate.
    """

    values: np.ndarray
    slopes: np.ndarray


class OdometryModel(Protocol):
    """Interface of the models; what they override is described here.

    Nodes have `width` unknowns: corrections x, y, yaw of the reported pose, then those of the model.

    The path between two nodes is the model's reference path, turned and scaled by `gain`. reference: returns its
    positions (m,) x + i y [m]; they are even where the motion is.
    mixture: priors of some unknowns of a node, of which one holds for the whole run; None where there is one only.
    rival: the model of another odometry that the vehicle may have; None where its kind was named.
    compass: how wrong the reported heading may be; None where none is reported.
    distance_deviation: relative standard deviation of reported distances; infinite where none are reported.
    position_walk: random walk of reported positions, m/sqrt(s).
    """

    width: int
    reference: Callable[[Motion], np.ndarray]
    mixture: Optional[PriorMixture] = None
    rival: "Optional[OdometryModel]" = None
    compass: "Optional[Compass]" = None
    distance_deviation: float
    position_walk: float

    @property
    def freed(self) -> "Optional[OdometryModel]":
        """The model of an odometry with which something is wrong; None where nothing is known that could be."""
        return None

    def stuck(self, begin: float, end: float) -> "OdometryModel":
        """Return the model of an odometry whose compass tells nothing from `begin` to `end` [s], where it has one."""
        return self

    @property
    def calibrated(self) -> Dict[str, int]:
        """Columns that the next run may start from, by name."""
        return {}

    def first_node(self) -> np.ndarray:
        """Return the unknowns (width,) expected at the first node, where the map's origin is the odometry's."""

    def first_deviations(self) -> np.ndarray:
        """Return their standard deviations (width,)."""

    def advanced(self, nodes: np.ndarray, motion: Motion) -> np.ndarray:
        """Return the unknowns (n, width) expected one step of `motion` (n + 1) after each of `nodes` (n, width)."""

    def steps(self, nodes: np.ndarray, motion: Motion) -> List[Residuals]:
        """Return what ties n `nodes` (n, width) together, whose columns stand one after the other; motion: (n)."""

    def gain(self, nodes: np.ndarray) -> np.ndarray:
        """Return the complex factors (n,) of the reference path after `nodes` (n, width)."""

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        """Return how the motion goes on after a node (width,) at which base_link has `heading` [rad] in map."""

    def fading(self, node: np.ndarray) -> Optional[Fading]:
        """Return how the rates of `drift` change with the time since the node (width,); None where they stay."""
        return None


class Change(NamedTuple):
    """How an unknown goes on from each of n - 1 nodes: which share of it is kept, and the variance of what is added."""

    kept: np.ndarray
    variance: np.ndarray


@dataclass(frozen=True)
class Compass:
    """How wrong the reported heading may be: standard deviations [rad], how long an error lasts [s].

    It errs differently where iron is near: for some minutes at the speed of a small vehicle. heading_walk: rad/sqrt(s),
    white noise of the turn rate besides. stuck: s, from when to when it tells nothing.
    """

    heading_deviation: float
    heading_correlation_time: float
    heading_walk: float
    stuck: Tuple[Tuple[float, float], ...] = ()

    def change(self, times: np.ndarray) -> Change:
        """Return how the correction of the reported heading changes from time to time: an error that lasts, a walk."""
        durations = np.diff(times)
        kept = np.exp(-durations / self.heading_correlation_time)
        variance = self.heading_deviation**2 * (1.0 - kept**2) + self.heading_walk**2 * durations
        for begin, end in self.stuck:
            variance += _TURN_WALK**2 * np.diff(np.clip(times, begin, end))
        return Change(kept, variance)

    @property
    def freed(self) -> "Compass":
        """A compass with which something is wrong: iron beside it, or a gyro that drifts."""
        return replace(self, heading_deviation=_FREED_HEADING, heading_correlation_time=_FREED_TIME)


def step_columns(nodes: np.ndarray, *columns: int) -> np.ndarray:
    """Return where `columns` (c,) of each of `nodes` (n, width) but the last stand, (n - 1, c)."""
    count, width = nodes.shape
    return width * np.arange(count - 1)[:, np.newaxis] + np.array(columns)


def changes_of(
    nodes: np.ndarray, times: np.ndarray, walks: Mapping[int, float], changes: Mapping[int, Change],
    compass: Optional[Compass],
) -> Residuals:  # fmt: skip
    """Return how unknowns of `nodes` (n, width) at `times` [s] change, by their columns.

    walks: deviations [1/sqrt(s)] of unknowns that only walk. changes: those of others. compass: that of which YAW is
    the error; None without one.
    """
    durations = np.diff(times)
    one = np.ones(len(durations))
    changes = {**changes, **{column: Change(one, each**2 * durations) for column, each in walks.items()}}
    if compass is not None:
        changes[YAW] = compass.change(times)
    columns, values = step_columns(nodes, *changes).T, nodes[:, list(changes)].T
    kept, variances = (np.stack(each) for each in zip(*changes.values()))
    places = np.stack([columns + nodes.shape[1], columns], axis=-1)
    jacobian = np.stack([np.ones_like(kept), -kept], axis=-1)
    weight = 1.0 / np.maximum(variances, _CONSTANT_DEVIATION**2)
    residual = values[:, 1:] - kept * values[:, :-1]
    return Residuals(places.reshape(-1, 2), jacobian.reshape(-1, 2), residual.ravel(), weight.ravel())
