"""Motion models of vehicles that report no positions: their velocity is unknown, and goes on as vehicles do."""

from dataclasses import dataclass, replace
from typing import Callable, Dict, Iterator, List, Optional

import numpy as np

from mlsm_manager.joint_solver.motion_models import (
    DRIFT_STATES,
    FIXED_DEVIATION,
    Change,
    Compass,
    Drift,
    OdometryModel,
    changes_of,
    step_columns,
)
from mlsm_manager.joint_solver.normal_equations import HELD_DEVIATION, YAW, Layout, Residuals
from mlsm_manager.joint_solver.odometry_log import Motion, as_complex, product, stretched
from mlsm_manager.scan_matching.scan import Fading
from node_support.geometry import harmonics

AHEAD, ASIDE, TRAVEL, TURN_RATE = 3, 4, 5, 6  # columns of the nodes, after x, y and yaw
_ROUNDING_VARIANCE = 1e-4  # m^2: of a step, so that steps of no duration do not divide by zero


@dataclass(frozen=True)
class Speeds:
    """How a vehicle changes its speed, in its own frame, since it keeps its speed ahead while it turns.

    The speed ahead changes around a speed of travel, which changes slowly; sideways the vehicle slips. Deviations in
    m/s, how long a difference lasts in s, travel_walk in m/s/sqrt(s).
    """

    start_speed_deviation: float
    speed_deviation: float
    speed_correlation_time: float
    travel_walk: float
    slip_deviation: float
    slip_correlation_time: float


class HeadingFactors(OdometryModel):
    """Nodes have columns x, y, yaw, then in base_link the speeds ahead and aside, and the speed of travel [m/s].

    The speed ahead forgets its difference from the speed of travel (an Ornstein-Uhlenbeck process), the speed aside
    forgets itself. Between nodes both speeds change evenly, which is where such a process is expected; what it strays
    from there by is the variance of the steps. Reported positions are not used.
    """

    width = 6
    distance_deviation = np.inf
    position_walk = np.inf

    def __init__(self, speeds: Speeds, compass: Optional[Compass]) -> None:
        self._speeds, self.compass = speeds, compass

    @property
    def freed(self) -> "HeadingFactors":
        return HeadingFactors(self._speeds, self.compass.freed)

    def stuck(self, begin: float, end: float) -> "HeadingFactors":
        return HeadingFactors(self._speeds, replace(self.compass, stuck=(*self.compass.stuck, (begin, end))))

    def first_node(self) -> np.ndarray:
        return np.zeros(self.width)

    def first_deviations(self) -> np.ndarray:
        """Without a compass the first heading defines the map."""
        own, fixed = self._speeds, FIXED_DEVIATION * 10.0
        heading = fixed if self.compass is None else self.compass.heading_deviation
        ahead = np.hypot(own.start_speed_deviation, own.speed_deviation)
        speeds = np.maximum([ahead, own.slip_deviation, own.start_speed_deviation], HELD_DEVIATION)
        return np.concatenate([[fixed, fixed, heading], speeds])

    def reference(self, motion: Motion) -> np.ndarray:
        """The path of a vehicle that always goes ahead."""
        return as_complex(motion.ahead)

    def gain(self, nodes: np.ndarray) -> np.ndarray:
        return nodes[..., AHEAD] + 1j * nodes[..., ASIDE]

    def advanced(self, nodes: np.ndarray, motion: Motion) -> np.ndarray:
        result, durations = nodes.copy(), np.diff(motion.times)
        kept, slipping = self._kept(durations)
        result[:, AHEAD] = nodes[:, TRAVEL] + kept * (nodes[:, AHEAD] - nodes[:, TRAVEL])
        result[:, ASIDE] = slipping * nodes[:, ASIDE]
        mean = (self.gain(nodes) + self.gain(result)) / 2.0
        step = stretched(np.diff(self.reference(motion)), mean, nodes[:, YAW])
        error = step - np.diff(motion.positions)
        result[:, 0] += error.real
        result[:, 1] += error.imag
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        """A scale of -1 leaves nothing of reported steps."""
        values, slopes = np.zeros(DRIFT_STATES), np.zeros((DRIFT_STATES, self.width))
        values[:2], values[3] = node[[AHEAD, ASIDE]], -1.0
        slopes[[0, 1], [AHEAD, ASIDE]] = 1.0
        return Drift(values, slopes)

    def fading(self, node: np.ndarray) -> Fading:
        own = self._speeds
        return Fading(
            np.array([node[TRAVEL], 0.0, 0.0]),
            np.array([own.speed_correlation_time, own.slip_correlation_time, np.inf]),
        )

    def steps(self, nodes: np.ndarray, motion: Motion) -> List[Residuals]:
        durations, walks = np.diff(motion.times), {TRAVEL: self._speeds.travel_walk}
        changes = changes_of(nodes, motion.times, walks, self._changes(durations), self.compass)
        return [*self._positions(nodes, motion), changes, self._speeds_ahead(nodes, durations)]

    def _kept(self, durations: np.ndarray) -> tuple:
        """Return which shares (n,) of the speeds ahead and aside are left after `durations` (n,) [s]."""
        times = self._speeds.speed_correlation_time, self._speeds.slip_correlation_time
        return tuple(np.exp(-durations / time) for time in times)

    def _changes(self, durations: np.ndarray) -> Dict[int, Change]:
        """Return how unknowns change from node to node that do not only walk."""
        _, slipping = self._kept(durations)
        return {ASIDE: Change(slipping, self._speeds.slip_deviation**2 * (1.0 - slipping**2))}

    def _speeds_ahead(self, nodes: np.ndarray, durations: np.ndarray) -> Residuals:
        own, (kept, _) = self._speeds, self._kept(durations)
        columns = step_columns(nodes, self.width + AHEAD, AHEAD, TRAVEL)
        jacobian = np.column_stack([np.ones(len(kept)), -kept, kept - 1.0])
        residual = nodes[1:, AHEAD] - kept * nodes[:-1, AHEAD] - (1.0 - kept) * nodes[:-1, TRAVEL]
        weight = 1.0 / np.maximum(own.speed_deviation**2 * (1.0 - kept**2), HELD_DEVIATION**2)
        return Residuals(columns, jacobian, residual, weight)

    def _positions(self, nodes: np.ndarray, motion: Motion) -> Iterator[Residuals]:
        yaw = (nodes[:-1, YAW] + nodes[1:, YAW]) / 2.0
        speeds = self.gain(nodes)
        ahead = product(np.exp(1j * yaw), np.diff(self.reference(motion)))
        step = product((speeds[:-1] + speeds[1:]) / 2.0, ahead)
        residual = np.diff(as_complex(nodes)) + np.diff(motion.positions) - step
        weight = 1.0 / (self._step_variance(np.diff(motion.times)) + _ROUNDING_VARIANCE)
        one, own = np.ones(len(step)), np.array([AHEAD, ASIDE, YAW])
        for axis, part in ((0, np.real), (1, np.imag)):
            columns = step_columns(nodes, self.width + axis, axis, *own, *(self.width + own))
            by_node = [-part(ahead) / 2.0, -part(1j * ahead) / 2.0, -part(1j * step) / 2.0]
            jacobian = np.column_stack([one, -one, *by_node, *by_node])
            yield Residuals(columns, jacobian, part(residual), weight)

    def _step_variance(self, durations: np.ndarray) -> np.ndarray:
        """Return the variances (n,) [m^2] of steps whose speeds at both ends are known, in each direction."""
        own = self._speeds
        ahead = _bridged(own.speed_deviation, own.speed_correlation_time, durations)
        aside = _bridged(own.slip_deviation, own.slip_correlation_time, durations)
        return (ahead + aside) / 2.0


class UnaidedFactors(HeadingFactors):
    """Nodes have the columns of HeadingFactors, and the turn rate [rad/s], which forgets itself."""

    width = 7

    def __init__(self, speeds: Speeds, deviation: float, correlation_time: float, heading_walk: float) -> None:
        """Of the turn rate: deviation [rad/s], correlation_time [s]; heading_walk: rad/sqrt(s), besides it."""
        super().__init__(speeds, None)
        self._deviation, self._correlation_time, self._heading_walk = deviation, correlation_time, heading_walk

    freed = None  # there is no compass that could be wrong

    def first_deviations(self) -> np.ndarray:
        return np.append(super().first_deviations(), self._deviation)

    def advanced(self, nodes: np.ndarray, motion: Motion) -> np.ndarray:
        durations = np.diff(motion.times)
        rate = nodes[:, TURN_RATE]
        half = nodes.copy()
        later = np.exp(-durations / self._correlation_time) * rate
        turn = (rate + later) / 2.0 * durations
        half[:, YAW] += turn / 2.0
        result = super().advanced(half, motion)
        result[:, YAW] += turn / 2.0
        result[:, TURN_RATE] = later
        return result

    def drift(self, node: np.ndarray, heading: float) -> Drift:
        known = super().drift(node, heading)
        values, slopes = known.values, known.slopes
        values[2], slopes[2, TURN_RATE] = node[TURN_RATE], 1.0
        return Drift(values, slopes)

    def fading(self, node: np.ndarray) -> Fading:
        known = super().fading(node)
        return replace(known, times=np.append(known.times[:2], self._correlation_time))

    def _changes(self, durations: np.ndarray) -> Dict[int, Change]:
        kept = np.exp(-durations / self._correlation_time)
        turn_rate = Change(kept, self._deviation**2 * (1.0 - kept**2))
        return {TURN_RATE: turn_rate, **super()._changes(durations)}

    def steps(self, nodes: np.ndarray, motion: Motion) -> List[Residuals]:
        durations = np.diff(motion.times)
        columns = step_columns(nodes, self.width + YAW, YAW, self.width + TURN_RATE, TURN_RATE)
        one, half = np.ones(len(durations)), durations / 2.0
        residual = np.diff(nodes[:, YAW]) - half * (nodes[1:, TURN_RATE] + nodes[:-1, TURN_RATE])
        short = np.minimum(durations**3 / (6.0 * self._correlation_time), durations**2)
        weight = 1.0 / (self._deviation**2 * short + self._heading_walk**2 * durations)
        turn = Residuals(columns, np.column_stack([one, -one, -half, -half]), residual, weight)
        return [*super().steps(nodes, motion), turn]


def _bridged(deviation: float, time: float, durations: np.ndarray) -> np.ndarray:
    """Return the variances of an integral over `durations` (n,) of a process that forgets, whose ends are known.

    The integral less the mean of both ends times the duration; for short durations that is a random walk's bridge.
    """
    return deviation**2 * np.minimum(durations**3 / (6.0 * time), 2.0 * time * durations)


# Of the cosine and sine of the heading (iron that is magnetic itself) and of twice the heading (soft iron): times the
# heading's deviation at any time, usually one degree. Iron makes small vehicles' compasses err by 5 to 10 degrees where
# nobody calibrated them on board, and nobody tells whether that was done.
_TIMES = np.array([5.0, 5.0, 1.0, 1.0])


def by_heading(
    compass: Compass, layout: Layout, yaws: np.ndarray, times: np.ndarray, solve: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return columns (size, 4) whose outer product is what the error adds to the covariance of all unknowns.

    yaws: (n,) rad, reported at the nodes of `layout`, at `times` (n,) [s]. solve: the information's inverse times
    columns. The error is an unknown of its own that is eliminated; the solution stays where it is.
    """
    errors, change = harmonics(yaws) * _TIMES * compass.heading_deviation, compass.change(times)
    steps = errors[1:] - change.kept[:, np.newaxis] * errors[:-1]
    weighted = steps / change.variance[:, np.newaxis]
    first = errors[0] / compass.heading_deviation**2
    nodes = layout.node_start(np.arange(layout.first, layout.last + 1)) + YAW
    shared = np.zeros((layout.size, len(_TIMES)))
    shared[nodes[1:]] += weighted
    shared[nodes[:-1]] -= change.kept[:, np.newaxis] * weighted
    shared[nodes[0]] += first
    moved = solve(shared)
    left = np.eye(len(_TIMES)) + steps.T @ weighted + np.outer(errors[0], first) - shared.T @ moved
    return np.linalg.solve(np.linalg.cholesky(left), moved.T).T
