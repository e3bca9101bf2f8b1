"""Fits a whole run at once, starting from what the live solver found."""

from dataclasses import dataclass, replace
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.comparisons import support
from mlsm_manager.joint_solver.compiled_comparisons import Pairs
from mlsm_manager.joint_solver.estimate import misfit_covariance, scale_covariance
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.loops import CONVINCING, Loop, loops_of
from mlsm_manager.joint_solver.map_support import misfit_variances
from mlsm_manager.joint_solver.normal_equations import (
    POSE_COLUMNS,
    RUN_COLUMNS,
    YAW,
    NormalEquations,
    State,
    moves_between,
    solution_of,
)
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.prior_mixture import Gaussian
from mlsm_manager.joint_solver.solution import Fixes, Solution
from mlsm_manager.joint_solver.velocity_models import by_heading
from mlsm_manager.joint_solver.window import Window

_MOMENTUM = 0.6  # of the last move: neighbours give way slowly, plain steps shrink by a tenth each, these by a quarter
_PULLED_STEPS = 10  # with the pull of loops: comparisons meet by then
_FIXED_STEP = 0.3  # m: deviation of a step of a path that is fixed, within which scans then find their places
_CHUNK = 100  # nodes whose covariances are found at once, bounds the memory


@dataclass(frozen=True)
class BatchResult:
    """The whole run. steps: how many were taken. converged: the last one was as short as the parameters ask for.

    node_times: (n,) s. pose_covariances: (n, 3, 3) of the nodes' poses. run_covariance: (2, 2). told: what the echoes
    alone tell of the unknowns of a mixture of priors; None without one. log_likelihood: of echoes on surfaces, less
    that of odd motions.
    """

    state: State
    node_times: np.ndarray
    pose_covariances: np.ndarray
    run_covariance: np.ndarray
    steps: int
    converged: bool
    told: Optional[Gaussian]
    log_likelihood: float


@dataclass(frozen=True)
class QuickFit:
    """A fit of a whole run without covariances, which take as long as the fit itself: many are tried, and one is taken.

    run: as it began. state, steps, converged, log_likelihood: see BatchResult.
    """

    run: Solution
    state: State
    steps: int
    converged: bool
    log_likelihood: float

    @classmethod
    def of(cls, run: Solution) -> "QuickFit":
        """Return the fit of a run that begins at its state, which stays as it is."""
        problem = _Batch(run.with_state(run.state.copy()))
        steps, converged = problem.converge()
        return cls(run, problem.state, steps, converged, problem.log_likelihood())

    def with_covariances(self) -> BatchResult:
        """Return the fit with the covariances of its unknowns."""
        return _result(self.run, _solved_at(self.run, self.state), self.steps, self.converged)


@dataclass(frozen=True)
class PartResult:
    """What a part of a run says of sonar and odometry. node: (width,) the newest one's unknowns. run: (2,).

    covariance: (width + 2, width + 2) of both. steps: how many were taken.
    """

    node: np.ndarray
    run: np.ndarray
    covariance: np.ndarray
    steps: int


@dataclass(frozen=True)
class LoopClosure:
    """batch: the fit that the run speaks for. loops: places visited again that it goes back to; none where it does not.

    gain: of log likelihood, of the fit with loops over the one without; NaN where none was found.
    """

    batch: BatchResult
    loops: List[Loop]
    gain: float

    def to_mapping(self) -> Dict[str, Any]:
        return {
            "gain": None if np.isnan(self.gain) else round(self.gain, 1),
            "found": [loop.line() for loop in self.loops],
        }


def with_loops_closed(live: LiveSolver, batch: BatchResult) -> LoopClosure:
    """Return the fit with places visited again that their shape tells, if the run fits better so than in `batch`.

    What was found only pulls the run near; where it ends, comparisons of echoes and the odometry say alone.
    """
    loops = loops_of(live.solution.with_state(batch.state))
    if not loops:
        return LoopClosure(batch, [], np.nan)
    problem = _Batch(live.solution.with_state(batch.state.copy()), loops)
    for _ in range(_PULLED_STEPS):
        problem.step()
    other = fit_of(live.solution.with_state(problem.state))
    gain = other.log_likelihood - batch.log_likelihood
    return LoopClosure(other, loops, gain) if gain > CONVINCING else LoopClosure(batch, [], gain)


def fit_of(run: Solution, fixed_steps: Optional[State] = None) -> BatchResult:
    """Return the fit of a whole run that begins at its state, which stays as it is.

    fixed_steps: unknowns whose steps it keeps to _FIXED_STEP; None where none. That they are so well known is not said.
    """
    problem = _Batch(run.with_state(run.state.copy()), fixed_steps=fixed_steps)
    steps, converged = problem.converge()
    if fixed_steps is not None:
        problem = _solved_at(run, problem.state)
    return _result(run, problem, steps, converged)


def _solved_at(run: Solution, state: State) -> "_Batch":
    """Return the problem of a run as it is solved at a state, which stays."""
    problem = _Batch(run.with_state(state))
    problem.solve(run.parameters.cut)
    return problem


def _result(run: Solution, problem: "_Batch", steps: int, converged: bool) -> BatchResult:
    poses, of_run = problem.covariances()
    parts = run.parameters.parts_per_turn
    # How uncertain scans that fit nowhere make the place of each node.
    misfits = np.repeat(misfit_variances(run.with_state(problem.state), 0) / parts, parts)
    poses = poses + misfit_covariance(np.cumsum(np.append(0.0, misfits)))
    times, likelihood = run.log.node_times.copy(), problem.log_likelihood()
    return BatchResult(problem.state, times, poses, of_run, steps, converged, problem.told(), likelihood)


def likelihood_of(run: Solution, across: float = np.nan) -> float:
    """Return the log likelihood of a whole run at its state, as that of a fit.

    across: s, where only what scans before and after it tell of each other is to count; NaN for all.
    """
    return _Batch(run).log_likelihood(across)


def compared_since(run: Solution, begin: float) -> Tuple[float, float]:
    """Return how many comparisons a run has, each as it counts, and their log likelihood at its state.

    begin: s, from which on one of both was heard; NaN for all.
    """
    points, pairs = _Batch(run).met()
    if not np.isnan(begin):
        later = run.log.node_times[points.scans] >= begin
        pairs = pairs._replace(importance=pairs.importance * (later[pairs.rows] | later[pairs.neighbours]))
    return float(pairs.importance.sum()), support(pairs, points, points, run.parameters)


def fit_path(live: LiveSolver, start: State) -> State:
    """Return the unknowns of the fit that begins at `start` and keeps its steps, without covariances.

    Where next to nothing tells the way along a wall, a fit without fixed steps creeps to a standstill there.
    """
    problem = _Batch(live.solution.with_state(start.copy()), fixed_steps=start)
    problem.converge()
    return problem.state


def solved_part(live: LiveSolver, first: int) -> PartResult:
    """Return the fit of the scan `first` of `live` and all later ones alone, as if the run had begun with it.

    What `live` found is where the fit begins, but no belief of it.
    """
    problem = _Batch(live.solution.since(first))
    steps, _ = problem.converge()
    return PartResult(problem.state.nodes[-1].copy(), problem.state.run.copy(), problem.newest_covariance(), steps)


class _Batch(Window):
    """The problem of a whole run, which is a window that holds all of it; its state changes in place."""

    _solved = staticmethod(solution_of)

    def __init__(self, run: Solution, loops: Sequence[Loop] = (), fixed_steps: Optional[State] = None) -> None:
        # Single scans that were found in the map as it was, and what was in it before, are not believed again.
        super().__init__(replace(run, fixes=Fixes(), known=None), run.log.scan_count)
        self._loops, self._start, self._fixed_steps = loops, self.state.copy(), fixed_steps
        self._last_move, self._is_begun = np.zeros(self._layout.size), False

    def converge(self) -> Tuple[int, bool]:
        """Take as many steps as are needed, or allowed; return how many, and whether the last one was short enough."""
        window = self._parameters
        for taken in range(1, window.batch_iterations + 1):
            if self.step() < window.tolerance or self._step_deviations < window.stop_sigma:
                return taken, True
        return window.batch_iterations, False

    def step(self) -> float:
        """Take one Gauss-Newton step with momentum; return the root mean square of the plain step [m]."""
        equations = self.solve(self._parameters.cut, self._loops, self._start)
        # Its length in its own standard deviations: sqrt(step^T information step).
        length = np.sqrt(max(0.0, -equations.gradient @ self._solution.step))
        self._step_deviations = float(length) / float(np.sqrt(len(self.state.nodes)))
        move = self._solution.step + _MOMENTUM * self._last_move
        self.state.nodes += self._nodes_of(move)
        self.state.run += move[self._layout.run_start :]
        # The first step makes equal what is constant along a run and which the live path found anew at each node.
        self._last_move = move if self._is_begun else np.zeros_like(move)
        self._is_begun = True
        moves = self._nodes_of(self._solution.step)[:, :2]
        return float(np.sqrt((moves**2).sum(axis=1).mean()))

    def log_likelihood(self, across: float = np.nan) -> float:
        """Return the log likelihood of the state, see `likelihood_of`."""
        points, pairs = self.met()
        if not np.isnan(across):
            later = self._log.node_times[points.scans] >= across
            pairs = pairs._replace(importance=pairs.importance * (later[pairs.rows] != later[pairs.neighbours]))
        on_surfaces = support(pairs, points, points, self._parameters)
        return on_surfaces - 0.5 * self._expected().cost

    def _expected(self) -> NormalEquations:
        equations = super()._expected()
        if self._fixed_steps is not None:
            now, fixed = (self._motion.poses[:, :2] + state.nodes[:, :2] for state in (self.state, self._fixed_steps))
            steps = np.arange(len(now) - 1)[:, np.newaxis] + np.array([1, 0])
            equations.add(*moves_between(self._layout, steps, np.diff(now - fixed, axis=0), _FIXED_STEP))
        return equations

    def met(self) -> Tuple[PlacedPoints, Pairs]:
        """Return all points and their comparisons."""
        pairs, points, _ = self._surfaces_met(self._parameters.cut)[-1]
        return points, pairs

    def covariances(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return those of the nodes' poses (n, 3, 3) and of the run's unknowns (2, 2)."""
        run = self._layout.run_start + np.arange(RUN_COLUMNS)
        nodes = np.arange(self._layout.last + 1)
        chunks = [self._layout.pose_columns(nodes[start : start + _CHUNK]) for start in range(0, len(nodes), _CHUNK)]
        poses = np.concatenate([self._solution.covariances(chunk, self._held_covariance)[1] for chunk in chunks])
        places = self._motion.poses + self.state.nodes[:, :POSE_COLUMNS]
        by_scale = scale_covariance(places, self._parameters.world_scale_deviation(self._log))
        return poses + by_scale + self._by_heading(nodes), self._own_covariance(run)

    def _by_heading(self, nodes: np.ndarray) -> np.ndarray:
        """Return what a compass that errs by the heading adds to the covariances of the poses of `nodes` (n,)."""
        compass, motion = self._odometry.compass, self._motion
        if compass is None:
            return np.zeros((len(nodes), POSE_COLUMNS, POSE_COLUMNS))
        columns = by_heading(compass, self._layout, motion.poses[:, YAW], motion.times, self._solution.solve)
        moved = columns[self._layout.pose_columns(nodes)]
        return moved @ moved.transpose(0, 2, 1)

    def told(self) -> Optional[Gaussian]:
        """Return what the echoes alone tell of the unknowns of a mixture of priors; None without one."""
        mixture = self._odometry.mixture
        if mixture is None:
            return None
        return mixture.without(self._prior.term, self.state.nodes[-1], self.newest_covariance())

    def newest_covariance(self) -> np.ndarray:
        """Return that of the newest node's and the run's unknowns (width + 2, width + 2)."""
        return self._own_covariance(self._layout.with_run(np.array([self._layout.last]))[0])
