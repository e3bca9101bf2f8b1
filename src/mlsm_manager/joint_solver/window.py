"""The problem of one scan: the newest nodes against each other and against the nearest groups of frozen scans.

That of a whole run is a window in which all nodes are free.
"""

from dataclasses import dataclass, replace
from typing import Callable, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.comparisons import (
    Comparison,
    PostComparisons,
    add_comparisons,
    comparisons_of,
    support,
    weighted,
)
from mlsm_manager.joint_solver.estimate import LiveEstimate
from mlsm_manager.joint_solver.loops import Bend, Loop, pulls_of
from mlsm_manager.joint_solver.map_support import agreement
from mlsm_manager.joint_solver.motion_models import FIXED_DEVIATION
from mlsm_manager.joint_solver.normal_equations import (
    DELAY,
    POSE,
    POSE_COLUMNS,
    RANGE_SCALE,
    EquationSolution,
    Layout,
    NormalEquations,
    State,
    dense_solution,
    prior_of,
)
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.prior_mixture import AdaptedPrior
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.weak_directions import without_weak_directions

_AGE_DISTANCE = 5.0  # m by which the newest group counts as farther than the oldest: the oldest drifted least
_FADING = 0.1  # share of the reach within which a group fades out, so that none appears at once
_NO_DISTANCE = 1e-9  # m: keeps groups at one place from dividing by zero
# Inflates the earlier deviation of the delay: frozen scans keep the delay they were frozen with, so comparing with them
# overstates what is known.
_FORGOTTEN_DELAY = 2.0
_CUT_FACTOR = 0.7  # the cut shrinks so much from step to step
_PULLED_STEPS = 5  # with the pull of loops: comparisons meet by then
_MOST_RUN_STEP = {RANGE_SCALE: 0.02, DELAY: 0.3}  # a far-off linearisation cannot throw the calibration away


@dataclass(frozen=True)
class FrozenMap:
    """Points of frozen groups of scans, placed with the run's unknowns at `run` (2,).

    importance: (n,) factor of each point's weight, 0 at the border of what is near. numbers: (b,) the groups that are
    near, in the order of time. scans: (b, k) int, of each. group_importance: (b,) the factor of each.
    """

    points: PlacedPoints
    importance: np.ndarray
    numbers: np.ndarray
    scans: np.ndarray
    group_importance: np.ndarray
    run: np.ndarray


def nearest_groups(solution: Solution, before: int) -> FrozenMap:
    """Return the groups of scans nearest to the newest node among those that end before scan `before`."""
    log, each = solution.log, solution.parameters.group_scans
    count = before // each
    known = np.flatnonzero(~log.forgotten[: count * each : each])
    places = solution.node_places(np.append(known * each + each // 2, log.scan_count))
    distances = np.hypot(*(places[:-1] - places[-1]).T)
    distances = distances + _AGE_DISTANCE * known / max(count, 1)
    importance = np.zeros(count)
    importance[known] = fading(distances, solution.parameters.frozen_groups)
    numbers = np.flatnonzero(importance > 0.0)
    scans = numbers[:, np.newaxis] * each + np.arange(each)
    points = solution.placed(log.surfaces.points(log.surfaces.rows_of(scans.ravel())[0]))
    per_point = importance[points.scans // each]
    return FrozenMap(points, per_point, numbers, scans, importance[numbers], solution.state.run.copy())


_BESIDE = 5.0  # m between the places of groups that hear the same
_ENOUGH_BESIDE = 0.25  # of the groups that a scan is compared with: so many that hear the same hold the map


def superfluous(solution: Solution, first: int, last: int) -> np.ndarray:
    """Return which scans (scan_count,) bool of groups `first` to before `last` no later scan has to be compared with.

    Enough older groups lie beside each of these, and have drifted less.
    """
    scans, most = solution.parameters.group_scans, _ENOUGH_BESIDE * solution.parameters.frozen_groups
    middles = np.arange(last) * scans + scans // 2
    places, kept = solution.node_places(middles), ~solution.log.forgotten[middles]
    for group in range(first, last):
        older = places[:group][kept[:group]] - places[group]
        kept[group] &= np.count_nonzero(np.hypot(*older.T) < _BESIDE) < most
    result = np.zeros(solution.log.scan_count, dtype=bool)
    result[: last * scans] = np.repeat(~kept, scans)
    return result


def fading(distances: np.ndarray, most: int) -> np.ndarray:
    """Return factors (b,) of groups at `distances` (b,) [m]: 1 for near ones, falling to 0; at most `most` are above 0.

    They depend on the distances continuously. Groups at one distance fade together.
    """
    if len(distances) <= most:
        return np.ones(len(distances))
    border = np.partition(distances, most)[most]
    return np.clip((border - distances) / max(_FADING * border, _NO_DISTANCE), 0.0, 1.0)


def joint_covariance(covariances: np.ndarray) -> np.ndarray:
    """Return (3 b, 3 b) of the poses of b frozen places with `covariances` (b, 3, 3).

    They are taken to be correlated as the places of a random walk are: by the ratio of their deviations.
    """
    deviations = np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
    ratio = np.minimum.outer(deviations, deviations) / np.maximum.outer(deviations, deviations)
    factors = np.linalg.cholesky(covariances)
    joint = np.einsum("iac,jbc,ij->iajb", factors, factors, ratio)
    return joint.reshape(POSE_COLUMNS * len(covariances), POSE_COLUMNS * len(covariances))


class Window:
    """Moves the free nodes of a solution and its run's unknowns in place; state: these and the frozen nodes."""

    _solved: Callable[[NormalEquations], EquationSolution] = staticmethod(dense_solution)

    def __init__(
        self,
        solution: Solution,
        free_nodes: int,
        estimates: Sequence[LiveEstimate] = (),
        covariances: Optional[np.ndarray] = None,
        start: Optional[np.ndarray] = None,
    ) -> None:
        """free_nodes: how many of the newest nodes may move besides the one before them; all others are frozen.

        estimates: one per earlier scan. covariances: (f, 3, 3) of the frozen nodes' poses, at least as many as there
        are, if any. start: (3,) standard deviations of the first node's pose, None where it defines the map.
        """
        self._run, self._log, self.state = solution, solution.log, solution.state
        self._odometry, self._parameters = solution.parameters.odometry, solution.parameters
        last = self._log.scan_count
        first = max(0, last - free_nodes)
        self._frozen = nearest_groups(solution, first)
        self._group_scans = self._parameters.group_scans
        self._recent = first - first % self._group_scans
        self._layout = Layout(first, last, self._odometry.width, self._groups(first))
        middles = np.append(self._frozen.scans[:, self._group_scans // 2], first)
        self._held_covariance = joint_covariance(covariances[middles]) if first else np.zeros((0, 0))
        self._recent_points = self._log.surfaces.heard(self._recent, last)
        self._motion = self._log.node_motion(np.arange(first, last + 1))
        self._mean, deviations = self._beliefs_of(estimates[first - 1]) if first else self._beliefs_before(start)
        held = self._layout.size + len(self._held_covariance) + np.arange(-POSE_COLUMNS, 0) if first else ()
        columns = self._layout.with_run(np.array([first]))[0]
        self._believed = prior_of(columns, np.zeros(len(columns)), deviations, held)
        self._known, self._are_apart = solution.known, solution.submaps.numbers.any()
        self._solution: Optional[EquationSolution] = None
        self._met: List[Comparison] = []
        self._posts = self._post_comparisons()
        newest = self._layout.node_start(last)
        self._prior = AdaptedPrior(self._odometry.mixture, solution.prior_term, newest)

    def _post_comparisons(self) -> Optional[PostComparisons]:
        """Return those with the frozen groups and with the scans since; None where posts are ignored."""
        if not self._parameters.post_confidence:
            return None
        recent = np.arange(self._recent, self._layout.last)
        importance = np.repeat(self._frozen.group_importance, self._group_scans)
        scans, importance = np.append(self._frozen.scans, recent), np.append(importance, np.ones(len(recent)))
        same = self._run.submaps.numbers[scans] == self._run.submaps.newest
        return PostComparisons(self._log.posts, self._parameters, scans[same], importance[same])

    def _groups(self, first: int) -> np.ndarray:
        """Return the group (first,) of each frozen node: its group's, and one more for nodes beside the window."""
        number_of_group = np.full(first // self._group_scans + 1, -1)
        number_of_group[self._frozen.numbers] = np.arange(len(self._frozen.numbers))
        number_of_group[-1] = len(self._frozen.numbers)
        return number_of_group[np.arange(first) // self._group_scans]

    def fit(self, bend: Optional[Bend] = None) -> None:
        """Move the free nodes to the solution; the loops of a bend only pull them near."""
        cut = self._parameters.wide_cut
        for _ in range(_PULLED_STEPS if bend else 0):
            self.solve(cut, bend.loops, bend.start)
            self._move()
        for _ in range(self._parameters.live_iterations):
            self.solve(cut)
            self._move()
            cut = max(self._parameters.cut, _CUT_FACTOR * cut)

    def solve(self, cut: float, loops: Sequence[Loop] = (), start: Optional[State] = None) -> NormalEquations:
        """Find the next Gauss-Newton step, and how well all is known, with points up to `cut` [m] apart.

        loops: that pull, as found at the unknowns `start`. Return the equations that were solved.
        """
        equations = self._expected()
        if self._run.fixes:
            self._run.fixes.add(equations, self._layout, self._motion.poses, self.state.nodes[self._layout.first :])
        met = self._surfaces_met(cut)
        add_comparisons(equations, self._layout, met, self._parameters, cut)
        if self._posts is not None:
            self._posts.add(equations, self._layout, self._run.placed(self._posts.points), cut)
        self._prior.add(equations, self.state.nodes[-1], self._own_covariance)
        if loops:
            equations.add(*pulls_of(loops, self._layout, self.state.nodes, start))
        self._solution = self._solved(equations)
        return equations

    def _own_covariance(self, columns: np.ndarray) -> np.ndarray:
        """Return the covariance (k, k) of unknowns (k,) if the frozen map had no error."""
        return self._solution.covariances(columns[np.newaxis], self._held_covariance)[1][0]

    def _expected(self) -> NormalEquations:
        """Return what is expected of the free unknowns without any echo."""
        equations, first = NormalEquations(self._layout.size, len(self._held_covariance)), self._layout.first
        off = np.append(self.state.nodes[first], self.state.run) - self._mean
        if first:
            off[POSE] = 0.0
        steps = self._odometry.steps(self.state.nodes[first:], self._motion)
        equations.add(self._believed._replace(values=off), *steps)
        return equations

    def _beliefs_before(self, start: Optional[np.ndarray]) -> Tuple[np.ndarray, np.ndarray]:
        """Return mean and deviations, (width + 2,) each, of the run's first node and of the run's unknowns."""
        deviations = self._odometry.first_deviations()
        if start is not None:
            deviations[POSE] = start
        mean = np.append(self._odometry.first_node(), self._parameters.run_mean(self._log))
        return mean, np.append(deviations, self._parameters.run_deviations(self._log))

    def _beliefs_of(self, frozen: LiveEstimate) -> Tuple[np.ndarray, np.ndarray]:
        """Return mean and deviations, (width + 2,) each, of the first free node and of the run's unknowns.

        It is what was known when this node was the newest: the window's scans are not in that. Of unknowns with a
        mixture of priors it is what was known without that, which the newest node has.
        """
        node, deviations, mixture = frozen.node.copy(), frozen.deviations, self._odometry.mixture
        if mixture is not None:
            known = mixture.without(frozen.prior_term, node, frozen.own_covariance)
            columns = list(mixture.columns)
            forgotten = mixture.walks**2 * float(self._motion.times[-1] - self._motion.times[0])
            node[columns], deviations[columns] = known.mean, np.sqrt(np.diag(known.covariance) + forgotten)
        deviations[len(node) + DELAY] *= _FORGOTTEN_DELAY
        deviations[POSE] = FIXED_DEVIATION
        return np.append(node, frozen.run), deviations

    def _surfaces_met(self, cut: float) -> List[Comparison]:
        """Return the comparisons of the free scans with all surfaces up to `cut` [m] apart, as they are summed."""
        parameters, frozen = self._parameters, self._frozen.points
        # To first order.
        frozen = replace(frozen, places=frozen.places + frozen.by_run @ (self.state.run - self._frozen.run))
        placed = frozen, self._run.placed(self._recent_points)
        surfaces, weak = without_weak_directions(placed, parameters)
        recent = surfaces[1]
        sources = recent.selected(slice(int(np.searchsorted(recent.scans, self._layout.first)), None))
        met = comparisons_of(sources, surfaces, cut, self._group_scans, parameters.min_cosine)
        if self._known is not None:
            to_known, known = self._known.compared(sources, cut, parameters)
            known = weak.without(known, sources.scans[to_known.rows])
            met.insert(1, (to_known, sources, known))
        submaps = self._run.submaps
        self._met = [(submaps.within(*one), *one[1:]) for one in met] if self._are_apart else met
        (to_frozen, *compared), *others = self._met
        return [(weighted(to_frozen, self._frozen.importance), *compared), *others]

    def _nodes_of(self, unknowns: np.ndarray) -> np.ndarray:
        return unknowns[: self._layout.run_start].reshape(-1, self._layout.width)

    def _move(self) -> None:
        step = self._solution.step
        self.state.nodes[self._layout.first :] += self._nodes_of(step)
        for column, most in _MOST_RUN_STEP.items():
            self.state.run[column] += np.clip(step[self._layout.run_start + column], -most, most)

    def log_likelihood(self) -> float:
        """Return that of the free nodes: of echoes on surfaces, less that of odd motions."""
        met = self._surfaces_met(self._parameters.cut)
        return sum(support(*some, self._parameters) for some in met) - 0.5 * self._expected().cost

    @property
    def oldest(self) -> int:
        return self._layout.first

    def covariances_of_oldest(self, count: int) -> np.ndarray:
        """Return the pose covariances (count + 1, 3, 3) of the oldest free nodes, the next ones to be frozen."""
        columns = self._layout.pose_columns(self._layout.first + np.arange(count + 1))
        return self._solution.covariances(columns, self._held_covariance)[0]

    def estimates(self, count: int) -> List[LiveEstimate]:
        """Return what is known of the newest `count` nodes, oldest first."""
        nodes = self._layout.last + np.arange(1 - count, 1)
        covariances = self._solution.covariances(self._layout.with_run(nodes), self._held_covariance)
        return [self._estimate(*each) for each in zip(nodes, *covariances)]

    def _compared(self, scan: int) -> int:
        """Return how many points of a scan were compared with those of others."""
        rows = [pairs.rows[sources.scans[pairs.rows] == scan] for pairs, sources, _ in self._met]
        posts = 0 if self._posts is None else np.count_nonzero(self._posts.compared == scan)
        return len(np.unique(np.concatenate(rows))) + posts

    def _estimate(self, number: int, covariance: np.ndarray, own_covariance: np.ndarray) -> LiveEstimate:
        """Return what is known of node `number`, at the end of the scan before it; covariances: as LiveEstimate's."""
        T_odom_base, node = self._motion.poses[number - self._layout.first], self.state.nodes[number].copy()
        T_map_base = T_odom_base + node[POSE]
        share, distance, surfaces = agreement(self._met, number - 1, self._parameters)
        return LiveEstimate(
            time=float(self._log.node_times[number]), T_odom_base=T_odom_base, T_map_base=T_map_base,
            node=node, run=self.state.run.copy(), covariance=covariance, own_covariance=own_covariance,
            world_scale_deviation=self._parameters.world_scale_deviation(self._log),
            reported_velocity=self._log.odometry.velocity_at(self._log.node_times[number]),
            drift=self._odometry.drift(node, T_map_base[2]), comparisons=self._compared(number - 1),
            agreement=share, distance=distance, surfaces=surfaces, prior_term=self._prior.term,
        )  # fmt: skip
