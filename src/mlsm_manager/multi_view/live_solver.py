"""Follows the vehicle scan by scan: the newest nodes are free, what is older stays where it was found."""

from typing import List, Optional

import numpy as np

from mlsm_manager.matching.scan import Scan
from mlsm_manager.multi_view.association import BlockIndex, blocks_of, pairs_between
from mlsm_manager.multi_view.comparisons import add_comparisons
from mlsm_manager.multi_view.dvl_factors import DvlFactors
from mlsm_manager.multi_view.estimate import LiveEstimate
from mlsm_manager.multi_view.normal_equations import DenseSolution, NormalEquations
from mlsm_manager.multi_view.parameters import MultiViewParameters
from mlsm_manager.multi_view.placement import PlacedPoints, place
from mlsm_manager.multi_view.priors import add_belief, run_deviations, run_mean
from mlsm_manager.multi_view.run_log import RunLog
from mlsm_manager.multi_view.state import DELAY, RANGE_SCALE, RUN_COLUMNS, Layout, State

_CUT_FACTOR = 0.7  # the cut shrinks so much from step to step
_MOST_RUN_STEP = {RANGE_SCALE: 0.02, DELAY: 0.3}  # a far-off linearisation cannot throw the calibration away


class LiveSolver:
    """Takes one scan at a time; the cost of a scan does not grow with the length of the run.

    sonar_in_base: (2,) m.
    """

    def __init__(self, parameters: MultiViewParameters, sonar_in_base: np.ndarray) -> None:
        self.parameters = parameters
        self.log = RunLog(sonar_in_base)
        self.odometry = DvlFactors(parameters.odometry)
        self.state = State(self.odometry.first_node()[np.newaxis], run_mean(parameters.sonar))
        self.estimates: List[LiveEstimate] = []

    def add(self, scan: Scan) -> LiveEstimate:
        """Take the next scan and return where the vehicle was at its end, as known from all scans so far.

        Raises RefusedInput for a scan that does not end later than the one before.
        """
        self.log.append(scan, self.parameters.window.lookahead)
        self._append_node()
        window = _Window(self)
        cut = self.parameters.matching.wide_cut
        for _ in range(self.parameters.window.live_iterations):
            window.step(cut)
            cut = max(self.parameters.matching.cut, _CUT_FACTOR * cut)
        self.estimates.append(window.estimate())
        return self.estimates[-1]

    def _append_node(self) -> None:
        last = self.log.scan_count
        poses = self.log.node_poses(last - 1, last)
        node = self.odometry.next_node(self.state.nodes[-1], poses[0], poses[1])
        self.state = State(np.vstack([self.state.nodes, node]), self.state.run)


class _Window:
    """The problem of one scan: nodes first to last are free."""

    def __init__(self, solver: LiveSolver) -> None:
        self._solver, self._log, self._state = solver, solver.log, solver.state
        self._parameters = solver.parameters
        last = self._log.scan_count
        first = max(0, last - self._parameters.window.free_nodes)
        self._layout = Layout(first, last, solver.odometry.width)
        block_scans = self._parameters.matching.block_scans
        self._recent = first // block_scans * block_scans
        self._times = self._log.node_times[first : last + 1]
        self._poses = self._log.node_poses(first, last)
        self._frozen = place(self._log, self._state, 0, self._recent)
        self._frozen_run = self._state.run.copy()
        self._frozen_blocks: List[BlockIndex] = blocks_of(self._frozen, block_scans)
        self._solution: Optional[DenseSolution] = None
        self._comparisons = 0

    def step(self, cut: float) -> None:
        """Take one Gauss-Newton step."""
        equations = NormalEquations(self._layout.size)
        self._add_beliefs(equations)
        free = self._state.nodes[self._layout.first :]
        self._solver.odometry.add_steps(equations, self._layout, free, self._times, self._poses)
        self._comparisons = self._add_surfaces(equations, cut)
        self._solution = DenseSolution(equations)
        self._move(self._solution.step)

    def _add_beliefs(self, equations: NormalEquations) -> None:
        first, run = self._layout.first, self._state.run
        odometry, sonar = self._solver.odometry, self._parameters.sonar
        if first == 0:
            mean, deviations = odometry.first_node(), odometry.first_deviations()
            run_belief = (run_mean(sonar), run_deviations(sonar))
        else:
            known = self._solver.estimates[first - 1]
            mean = np.concatenate([self._state.nodes[first, :3], known.node[3:]])
            deviations = odometry.frozen_deviations(known.node_deviations)
            run_belief = (known.run, known.run_deviations)
        add_belief(equations, 0, self._state.nodes[first], mean, deviations)
        add_belief(equations, self._layout.run_start, run, *run_belief)

    def _add_surfaces(self, equations: NormalEquations, cut: float) -> int:
        matching = self._parameters.matching
        recent = place(self._log, self._state, self._recent, self._layout.last)
        free = recent.scans >= self._layout.first
        sources = recent.selected(free)
        frozen = self._frozen.moved_by_run(self._state.run - self._frozen_run)
        count = 0
        for targets, blocks in ((frozen, self._frozen_blocks), (recent, blocks_of(recent, matching.block_scans))):
            pairs = pairs_between(sources, targets, blocks, cut, matching)
            count += add_comparisons(equations, self._layout, pairs, sources, targets, matching, cut)
        return count

    def _move(self, step: np.ndarray) -> None:
        nodes = step[: self._layout.run_start].reshape(-1, self._layout.width)
        self._state.nodes[self._layout.first :] += nodes
        for column, most in _MOST_RUN_STEP.items():
            self._state.run[column] += np.clip(step[self._layout.run_start + column], -most, most)

    def estimate(self) -> LiveEstimate:
        """Return what is known of the newest node."""
        width, size = self._layout.width, self._layout.size
        newest = np.zeros((size, width + RUN_COLUMNS))
        newest[size - width - RUN_COLUMNS :] = np.eye(width + RUN_COLUMNS)
        covariance = self._solution.solve(newest)[size - width - RUN_COLUMNS :]
        return LiveEstimate(
            time=float(self._times[-1]), odometry_pose=self._poses[-1], node=self._state.nodes[-1].copy(),
            run=self._state.run.copy(), covariance=covariance, comparisons=self._comparisons,
        )  # fmt: skip
