"""Follows the vehicle scan by scan: the newest nodes are free, what is older stays where it was found."""

from dataclasses import replace
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.estimate import LiveEstimate, expected_deviations
from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.loops import CONVINCING, Bend, Loop, confirmed, with_newest
from mlsm_manager.joint_solver.map_support import FrozenPlaces, misfits_with_newest
from mlsm_manager.joint_solver.motion_models import SCALE, OdometryModel
from mlsm_manager.joint_solver.normal_equations import POSE_COLUMNS, YAW, State
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.places import PlaceCandidate, put_newest, put_submap, silent_before
from mlsm_manager.joint_solver.prior_mixture import Gaussian
from mlsm_manager.joint_solver.run_log import RunLog, stacked, unstacked
from mlsm_manager.joint_solver.solution import Fix, Fixes, Solution, Submaps
from mlsm_manager.joint_solver.window import Window, superfluous
from mlsm_manager.scan_matching.scan import Scan
from node_support.errors import RefusedInput

ODOMETRY = "odometry"  # under which the name of a run's model is stored
_ESTIMATE = "estimate."
_SUBMAPS = "islands"  # the name in stored maps
_FREE_ANEW = 10  # free scans where a run is followed anew: fewer than usual, as a fit of the whole run follows
_FORGOTTEN_AT_ONCE = 60  # scans: a multiple of the usual numbers of parts of a turn; takes some milliseconds


class LiveSolver:
    """Takes one scan at a time; the cost of a scan does not grow with the length of the run.

    log: the scans, which solvers with other odometries may share. estimates: one per scan of the log, None for old
    ones but the first turn's. state: the unknowns as they are known now.
    submaps: which scans are compared with each other. search: what came of the search for the newest scans in the map
    after scans that heard nothing; None where none was needed. closed: the loop that was closed with the newest scan.
    """

    def __init__(
        self,
        parameters: SolverParameters,
        log: RunLog,
        start: Optional[np.ndarray] = None,
        known: Optional[KnownSurfaces] = None,
    ) -> None:
        """`log`: without scans. `start`: (3,) standard deviations of the first pose in the map, m, m, rad; None: it
        defines the map. `known`: surfaces that the map has already.
        """
        self.parameters, self.log, self.odometry = parameters, log, parameters.odometry
        self.estimates: List[Optional[LiveEstimate]] = []
        self.state = State(self.odometry.first_node()[np.newaxis], parameters.run_mean(log))
        self._frozen = FrozenPlaces(np.empty((0, POSE_COLUMNS, POSE_COLUMNS)), np.empty(0))
        self._start, self._known = start, known
        self.submaps = Submaps(np.empty(0))
        self.fixes = Fixes()
        self.search: Optional[PlaceCandidate] = None
        self.closed = ""
        self._may_bend = known is None
        self._loops: Tuple[Loop, ...] = ()
        self._by_parts = parameters.node_search
        self._forgotten_until = self._silent = 0

    def stored(self) -> Dict[str, np.ndarray]:
        """Return all but the scans that `resumed` needs, as arrays by name, which the next scan does not change."""
        return {
            ODOMETRY: name_of(self.odometry),
            "nodes": self.state.nodes.copy(),
            "node_covariances": self._frozen.covariances,
            "run_unknowns": self.state.run.copy(),
            "misfits": self._frozen.misfits,
            "start": np.empty(0) if self._start is None else self._start,
            "known": np.empty((0, 2)) if self._known is None else self._known.places,
            _SUBMAPS: self.submaps.numbers,
            **self.fixes.stored(),
            **({} if self._by_parts is None else self._by_parts.stored()),
            **stacked(self.estimates, _ESTIMATE),
        }

    @classmethod
    def resumed(cls, parameters: SolverParameters, log: RunLog, stored: Mapping[str, np.ndarray]) -> "LiveSolver":
        """Return a solver that goes on after the scans of `log` as the one did that took them and was `stored` then.

        Raises ValueError and KeyError for arrays and scans that do not belong together.
        """
        if not np.array_equal(stored[ODOMETRY], name_of(parameters.odometry)):
            name = stored[ODOMETRY].tobytes().decode("ascii", "replace")
            raise ValueError(
                f"it was stored with another odometry profile: {name}, not {type(parameters.odometry).__name__}"
            )
        start, known, scans = stored["start"], stored["known"], log.scan_count
        solver = cls(parameters, log, start if len(start) else None, KnownSurfaces(known) if len(known) else None)
        solver._may_bend = False  # the map that was stored with it is not drawn anew
        nodes, covariances = stored["nodes"], stored["node_covariances"]
        if nodes.shape != (scans + 1, solver.odometry.width) or covariances.shape[1:] != (POSE_COLUMNS, POSE_COLUMNS):
            raise ValueError(f"nodes {nodes.shape}, covariances {covariances.shape} for {scans} scans")
        solver.state = State(nodes, stored["run_unknowns"]).copy()
        solver._frozen = FrozenPlaces(covariances, stored["misfits"])
        solver.submaps, solver.fixes = Submaps(stored[_SUBMAPS]), Fixes.of_arrays(stored)
        if solver._by_parts is not None:
            solver._by_parts = solver._by_parts.resumed(log, parameters, stored)
        solver.estimates += unstacked(LiveEstimate, stored, _ESTIMATE)
        for name, found in (("estimates", solver.estimates), ("submaps", stored[_SUBMAPS])):
            if len(found) != scans:
                raise ValueError(f"{len(found)} {name} for {scans} scans")
        return solver

    def begun_with(self, parameters: SolverParameters, log: RunLog) -> "LiveSolver":
        """Return a solver with other parameters that begins where this one began; log: without scans."""
        return LiveSolver(parameters, log, self._start, self._known)

    @property
    def solution(self) -> Solution:
        """The run as it is known now, until the next scan."""
        term = self.estimates[-1].prior_term if self.estimates else None
        return Solution(self.log, self.parameters, self.state, self.submaps, self._known, term, self.fixes)

    @property
    def told(self) -> Gaussian:
        """What the echoes so far alone tell of the unknowns of a mixture of priors, which the model must have."""
        newest = self.estimates[-1]
        return self.odometry.mixture.without(newest.prior_term, newest.node, newest.covariance)

    def expected_deviations(self, estimates: Sequence[LiveEstimate]) -> np.ndarray:
        """Return by how much (n,) [m] the positions of `estimates` are uncertain whatever the water tells.

        Compass and lengths make that, and the first turn, whose own motion nothing tells.
        """
        begin, lengths = self.estimates[self._parts - 1], np.array([one.length_deviation for one in estimates])
        moves = np.array([one.T_map_base[:2] - begin.T_map_base[:2] for one in estimates])
        return np.hypot(begin.stated_deviation, expected_deviations(moves, lengths, self.heading_deviation))

    @property
    def heading_deviation(self) -> float:
        """Standard deviation [rad] of the heading before the run."""
        return float(self.odometry.first_deviations()[YAW])

    @property
    def distance_deviation(self) -> float:
        """Relative standard deviation of reported distances as known now; infinite where none are reported."""
        if self.odometry.mixture is None or not self.estimates:
            return self.odometry.distance_deviation
        return float(self.estimates[-1].deviations[SCALE])

    def add(self, scan: Scan, fix: Optional[Fix] = None) -> LiveEstimate:
        """Put the next scan into the log, and return what `solve` says of it.

        It may be cut into parts (`parts_per_turn`), each then a scan of the log with an estimate of its own.

        Raises RefusedInput, and stays as it is, for a scan that does not end later than the one before, or with which
        the fit has no finite solution.
        """
        scans = self.log.scan_count
        self.log.take([scan], self._parts, self.parameters.lookahead)
        try:
            estimate = self.solve(fix)
        except RefusedInput:
            self.log.shorten(scans)
            raise
        self._forget_old()
        return estimate

    def solve(self, fix: Optional[Fix] = None) -> LiveEstimate:
        """Return where the vehicle was at the end of the newest scan of the log, as known from all of them.

        fix: where the scan alone was found in the map, where somebody looked. Raises RefusedInput, and stays as it is,
        where the fit has no finite solution.
        """
        scans, before, by_parts, loops = len(self.estimates), self.state.copy(), self._by_parts, self._loops
        self._silent = silent_before(self.log, self.log.scan_count - 1)
        for _ in range(scans, self.log.scan_count):
            self.submaps.append()
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                self.estimates += self._solved(fix)
        except (np.linalg.LinAlgError, ValueError) as error:
            # numpy and scipy raise a ValueError where they meet what is not finite.
            self.state = before
            self._by_parts, self._loops = by_parts, loops
            self.fixes.pop(self.log.scan_count, None)
            self.submaps.shorten(scans)
            text = f"the scan that ends at {self.log.node_times[-1]:.3f} s: {error}"
            raise RefusedInput("scans without a solution", text) from error
        old = range(self._parts, self._old_scans)
        self.estimates[self._parts : self._parts + len(old)] = [None] * len(old)
        return self.estimates[-1]

    @property
    def _parts(self) -> int:
        return self.parameters.parts_per_turn

    def _solved(self, fix: Optional[Fix]) -> List[LiveEstimate]:
        """Return what is known of the scans of the log that have no estimates yet."""
        state = self.state
        for node in range(len(state.nodes), self.log.scan_count + 1):
            motion = self.log.node_motion(np.array([node - 1, node]))
            newest = self.odometry.advanced(state.nodes[-1:], motion)
            state.nodes = np.append(state.nodes, newest, axis=0)
        self.search = None
        if fix is None:
            self._search()
        else:
            self.fixes[self.log.scan_count] = fix
            state.nodes[-1, :YAW] = fix.place - self.log.node_poses(np.array([self.log.scan_count]))[0, :YAW]
        window = self._fitted()
        if self.submaps.is_apart:
            self.search = put_submap(self.solution, window.estimates(1)[0].covariance[:2, :2])
            if self.search.is_certain:
                window = self._fitted()
        self.closed = ""
        # Parts of a turn hear too little for it, and some maps never move.
        if self._parts == 1 and self._may_bend and not self.submaps.is_apart:
            window = self._closed(window)
        estimates, covariances = window.estimates(self._parts), window.covariances_of_oldest(self._parts)
        self._frozen = FrozenPlaces(
            np.append(self._frozen.covariances[: window.oldest], covariances, axis=0),
            misfits_with_newest(self.solution, self._frozen.misfits),
        )
        variance = float(self._frozen.misfits.sum()) + (0.0 if self._by_parts is None else self._by_parts.variance)
        return [replace(estimate, misfit_variance=variance) for estimate in estimates]

    @property
    def _old_scans(self) -> int:
        """How many scans of the log are so old that they are forgotten, many at once; none of before a silence."""
        kept = max(self.parameters.kept_scans * self._parts, self._silent + 2 * self._parts)
        return max(self.log.scan_count - kept, 0) // _FORGOTTEN_AT_ONCE * _FORGOTTEN_AT_ONCE

    def _forget_old(self) -> None:
        """Forget what no later scan needs."""
        old = self._old_scans
        if old <= self._forgotten_until:
            return
        groups = np.array([self._forgotten_until, old]) // self.parameters.group_scans
        self.log.forget(superfluous(self.solution, *groups))
        self.log.thin_odometry(old)
        self._forgotten_until = old

    def _fitted(self, bend: Optional[Bend] = None) -> Window:
        """Return the newest nodes' problem after they were moved to its solution; loops only pull them near."""
        window = Window(
            self.solution, self.parameters.free_nodes, self.estimates, self._frozen.covariances, self._start
        )
        window.fit(bend)
        return window

    def _closed(self, window: Window) -> Window:
        """Return the problem with the path bent to a place heard before, if the run then fits better."""
        self._loops = with_newest(self.solution, self._loops)
        loops = confirmed(self._loops, self.log.scan_count - 1)
        if not loops:
            return window
        now, before, found = self.state, window.log_likelihood(), []
        places = self._frozen.places(window.oldest, window.covariances_of_oldest(0))
        bend = Bend.of(loops, now, places)
        for share in bend.tried:
            self.state = bend.state(share)
            found.append((self._fitted(bend).log_likelihood() - bend.cost(share), share, self.state))
        likelihood, share, state = max(found, key=lambda one: one[0])
        if likelihood < before + CONVINCING:
            self.state = now
            return window
        self.state = state
        self._frozen = self._frozen.better(bend.left(share, np.trace(places, axis1=1, axis2=2))[: window.oldest])
        self._loops = ()
        self.fixes = Fixes()  # in the map as it was
        seconds = self.log.node_times[-1] - self.log.node_times[loops[-1].older + 1]
        metres = np.hypot(*(state.nodes[-1, :2] - now.nodes[-1, :2]))
        self.closed = f"found a place heard {seconds:.0f} s ago again: moved by {metres:.1f} m"
        return self._fitted()

    @property
    def found(self) -> str:
        """How the vehicle was found again with the newest scan after a silence; empty where it was not."""
        return self.search.line() if self.search is not None and self.search.is_certain else ""

    def _search(self) -> None:
        """Put the newest nodes where their scans fit, if the motion is hardly known; or let them begin a submap."""
        if self._parts == 1 and len(self.estimates) > self._silent:
            covariance = self.estimates[-1 - self._silent].own_covariance
            self.search = put_newest(self.solution, covariance, self._silent)
        if self._parts > 1 and self._by_parts is not None:
            self._by_parts = self._by_parts.followed(self.log, self.parameters)
            starts_known = self._known is not None or self._start is not None
            placed = self._by_parts.placed(self.log, self.state.nodes, self.parameters, starts_known)
            self.state.nodes[-len(placed) :] = placed


def followed_anew(run: Solution, first: int) -> State:
    """Return the unknowns of a run whose scans from `first` on are solved again, one after the other.

    That part is solved as if the run had begun with it, and then put where node `first` was; earlier nodes stay.

    Raises RefusedInput where a fit has no finite solution.
    """
    solver, parameters = None, replace(run.parameters, free_scans=_FREE_ANEW)
    for log in run.log.since(first).grown():
        solver = solver or LiveSolver(parameters, log)
        solver.solve()
    nodes = solver.state.nodes
    nodes[:, :YAW] += run.state.nodes[first, :YAW] - nodes[0, :YAW]
    return State(np.append(run.state.nodes[:first], nodes, axis=0), run.state.run)


def name_of(odometry: OdometryModel) -> np.ndarray:
    """Return the name of a model (n,) uint8, as a map's file keeps it: models of equal width mean other unknowns."""
    return np.frombuffer(type(odometry).__name__.encode(), dtype=np.uint8)
