"""Follows the vehicle scan by scan: the newest nodes are free, what is older stays where it was found."""

from dataclasses import replace
from typing import Dict, List, Mapping, Optional, Sequence

import numpy as np

from mlsm_manager.joint_solver.estimate import LiveEstimate, stacked, unstacked
from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.live_window import LiveWindow
from mlsm_manager.joint_solver.map_support import misfit_variances
from mlsm_manager.joint_solver.motion_models import OdometryModel
from mlsm_manager.joint_solver.normal_equations import POSE_COLUMNS, RUN_COLUMNS, State
from mlsm_manager.joint_solver.odometry_log import GrowingArray
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.place_search import place_after_silence, searched_node, silent_scans, submap_place
from mlsm_manager.joint_solver.places import PlaceCandidate
from mlsm_manager.joint_solver.run_log import RunLog, parts_of
from mlsm_manager.joint_solver.solution import Solution, Submaps
from mlsm_manager.scan_matching.scan import Scan
from node_support.errors import RefusedInput


class SolvedNodes:
    """Unknowns that every scan changes or adds to.

    covariances: rows (3, 3) of the poses of those nodes that stay where they were found. misfits: a variance [m^2] of
    the place for each turn of the head.
    """

    def __init__(self, first_node: np.ndarray, run: np.ndarray) -> None:
        """first_node: (width,) unknowns of the node before the first scan. run: (r,) unknowns of the run."""
        self._nodes = GrowingArray(len(first_node))
        self._nodes.extend(first_node[np.newaxis])
        self._run = run.copy()
        self.covariances = GrowingArray(POSE_COLUMNS, POSE_COLUMNS)
        self.misfits = GrowingArray()

    def __len__(self) -> int:
        """Number of nodes."""
        return len(self._nodes)

    @property
    def state(self) -> State:
        """The unknowns as they are known now, which may be changed in place; valid until nodes are added."""
        return State(self._nodes.values, self._run)

    def extend(self, nodes: np.ndarray) -> None:
        """Append nodes (m, width)."""
        self._nodes.extend(nodes)

    def replace_newest(self, nodes: np.ndarray) -> None:
        """Put nodes (m, width) in place of the m newest ones."""
        self._nodes.replace_from(len(self) - len(nodes), nodes)

    def take_back(self, state: State) -> None:
        """Have nodes and run as they were in `state`, a copy."""
        self._nodes.replace_from(0, state.nodes)
        self._run[:] = state.run

    def stored(self) -> Dict[str, np.ndarray]:
        """Return copies of all that `restore` needs, by name."""
        return {
            "nodes": self._nodes.values.copy(),
            "node_covariances": self.covariances.values.copy(),
            "run_unknowns": self._run.copy(),
            "misfits": self.misfits.values.copy(),
        }

    def restore(self, stored: Mapping[str, np.ndarray], scans: int) -> None:
        """Take what was `stored` after `scans`; raises ValueError for arrays of other shapes, KeyError for none."""
        nodes, covariances = stored["nodes"], stored["node_covariances"]
        width = self._nodes.values.shape[1]
        if nodes.shape != (scans + 1, width) or covariances.shape[1:] != (POSE_COLUMNS, POSE_COLUMNS):
            raise ValueError(f"nodes {nodes.shape}, covariances {covariances.shape} for {scans} scans")
        self.take_back(State(nodes, stored["run_unknowns"]))
        self.covariances.replace_from(0, covariances)
        self.misfits.replace_from(0, stored["misfits"])


_ESTIMATE = "estimate."
_SUBMAPS = "islands"  # the name in stored maps
_UNSETTLED_TURNS = 5  # a run's first scans correct each other, and a scan may be put right by the next ones
_CUT_FACTOR = 0.7  # the cut shrinks so much from step to step


class LiveSolver:
    """Takes one scan at a time; the cost of a scan does not grow with the length of the run.

    sonar_in_base: (2,) m, where the sonar is in base_link. estimates: one per scan of the log. state: of all nodes.
    submaps: which scans are compared with each other. search: what came of the search for the newest scans in the map
    after scans that heard nothing; None where none was needed.
    """

    def __init__(
        self,
        parameters: SolverParameters,
        sonar_in_base: np.ndarray,
        start: Optional[np.ndarray] = None,
        known: Optional[KnownSurfaces] = None,
    ) -> None:
        """`start`: (3,) standard deviations of the first pose in the map, m, m, rad; None: it defines the map.

        `known`: surfaces that the map has already.
        """
        self.parameters = parameters
        self.log = RunLog(sonar_in_base)
        self.odometry = parameters.odometry
        self.estimates: List[LiveEstimate] = []
        self._nodes = SolvedNodes(self.odometry.first_node(), parameters.run_mean)
        self._start, self._known = start, known
        self.submaps = Submaps(np.empty(0))
        self.search: Optional[PlaceCandidate] = None
        self._by_parts = parameters.node_search

    def stored(self) -> Dict[str, np.ndarray]:
        """Return all but the scans that `resumed` needs, as arrays by name, which the next scan does not change."""
        return {
            "odometry": _name_of(self.odometry),
            **self._nodes.stored(),
            "start": np.empty(0) if self._start is None else self._start,
            "known": np.empty((0, 2)) if self._known is None else self._known.places,
            _SUBMAPS: self.submaps.numbers,
            **({} if self._by_parts is None else self._by_parts.stored()),
            **stacked(self.estimates, _ESTIMATE),
        }

    @classmethod
    def resumed(
        cls,
        parameters: SolverParameters,
        sonar_in_base: np.ndarray,
        scans: Sequence[Scan],
        stored: Mapping[str, np.ndarray],
    ) -> "LiveSolver":
        """Return a solver that goes on after `scans` as the one did that took them and was `stored` then.

        Raises ValueError, KeyError and RefusedInput for arrays and scans that do not belong together.
        """
        if not np.array_equal(stored["odometry"], _name_of(parameters.odometry)):
            name = stored["odometry"].tobytes().decode("ascii", "replace")
            raise ValueError(
                f"it was stored with another odometry profile: {name}, not {type(parameters.odometry).__name__}"
            )
        start, known = stored["start"], stored["known"]
        solver = cls(
            parameters, sonar_in_base, start if len(start) else None, KnownSurfaces(known) if len(known) else None
        )
        for scan in scans:
            solver._append(scan)
        solver._nodes.restore(stored, solver.log.scan_count)
        solver.submaps = Submaps(stored[_SUBMAPS])
        if solver._by_parts is not None:
            solver._by_parts = solver._by_parts.resumed(solver.log, parameters, stored)
        solver.estimates += unstacked(LiveEstimate, stored, _ESTIMATE)
        for name, found in (("estimates", solver.estimates), ("submaps", stored[_SUBMAPS])):
            if len(found) != solver.log.scan_count:
                raise ValueError(f"{len(found)} {name} for {solver.log.scan_count} scans")
        return solver

    @property
    def state(self) -> State:
        """The unknowns as they are known now; a view that the next scan makes invalid."""
        return self._nodes.state

    @property
    def solution(self) -> Solution:
        """The run as it is known now; its state is a view that the next scan makes invalid."""
        return Solution(self.log, self.parameters, self.state, self.submaps, self._known)

    def add(self, scan: Scan) -> LiveEstimate:
        """Take the next scan and return where the vehicle was at its end, as known from all scans so far.

        It may be cut into parts (`parts_per_turn`), each then a scan of the log with an estimate of its own.

        Raises RefusedInput, and stays as it is, for a scan that does not end later than the one before, or with which
        the fit has no finite solution.
        """
        scans, before, by_parts = self.log.scan_count, self.state.copy(), self._by_parts
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                self._append(scan)
                self.estimates += self._solved()
        except RefusedInput:
            raise
        except (np.linalg.LinAlgError, ValueError) as error:
            # numpy and scipy raise a ValueError where they meet what is not finite.
            self._nodes.take_back(before)
            self._by_parts = by_parts
            self._shorten(scans)
            text = f"the scan that ends at {scan.reference_time:.3f} s: {error}"
            raise RefusedInput("scans without a solution", text) from error
        return self.estimates[-1]

    @property
    def _parts(self) -> int:
        return self.parameters.parts_per_turn

    def _append(self, scan: Scan) -> None:
        """Append the parts of a scan to the log, all or none."""
        scans = self.log.scan_count
        try:
            for part in parts_of(scan, self._parts, self.log.node_times[-1] if scans else None):
                self.log.append(part, self.parameters.lookahead)
                self.submaps.append()
        except RefusedInput:
            self._shorten(scans)
            raise

    def _shorten(self, scans: int) -> None:
        """Keep the oldest `scans` of the log."""
        while self.log.scan_count > scans:
            self.log.remove_newest()
        self.submaps.shorten(scans)

    def _solved(self) -> List[LiveEstimate]:
        """Return what is known of the scans of the log that have no estimates yet."""
        for node in range(len(self._nodes), self.log.scan_count + 1):
            motion = self.log.node_motion(np.array([node - 1, node]))
            self._nodes.extend(self.odometry.advanced(self.state.nodes[-1:], motion[:1], motion[1:]))
        self.search = None
        self._search()
        window = self._fitted()
        if self.submaps.is_apart and self._join(window.estimates(1)[0]):
            window = self._fitted()
        estimates, covariances = window.estimates(self._parts), window.covariances_of_oldest(self._parts)
        self._nodes.covariances.replace_from(window.oldest, covariances)
        variance = self._misfit_variance()
        return [replace(estimate, misfit_variance=variance) for estimate in estimates]

    def _misfit_variance(self) -> float:
        """Return that of the place after the newest turn [m^2]; the newest turns are judged where they are put now."""
        first = max(0, self.log.scan_count // self._parts - _UNSETTLED_TURNS)
        newest = misfit_variances(self.solution, first)
        self._nodes.misfits.replace_from(first, newest)
        return float(self._nodes.misfits.values.sum()) + (0.0 if self._by_parts is None else self._by_parts.variance)

    def _fitted(self) -> LiveWindow:
        """Return the newest nodes' problem after they were moved to its solution."""
        window = LiveWindow(self.solution, self.estimates, self._nodes.covariances.values, self._start)
        cut = self.parameters.wide_cut
        for _ in range(self.parameters.live_iterations):
            window.step(cut)
            cut = max(self.parameters.cut, _CUT_FACTOR * cut)
        return window

    @property
    def found(self) -> str:
        """How the vehicle was found again with the newest scan after a silence; empty where it was not."""
        return self.search.line() if self.search is not None and self.search.is_certain else ""

    def _search(self) -> None:
        """Put the newest nodes where their scans fit, if the motion is hardly known; or let them begin a submap."""
        if self._parts > 1:
            self._search_by_parts()
            return
        silent = silent_scans(self.log)
        if len(self.estimates) <= silent:
            return
        covariance = self.estimates[-1 - silent].own_covariance[:-RUN_COLUMNS, :-RUN_COLUMNS]
        parameters = self.parameters
        if silent:
            self.search = place_after_silence(self.solution, covariance, silent)
        if self.search is not None and self.search.is_certain and not self.submaps.is_apart:
            self._move(self.search.moves)
        elif self.search is not None and self.search.reach > parameters.wide_cut:
            self.submaps.begin()
        else:
            self._search_beside_scan_before(covariance)

    def _search_by_parts(self) -> None:
        """Put the newest nodes where the search for nodes finds them likeliest."""
        if self._by_parts is not None:
            self._by_parts = self._by_parts.followed(self.log, self.parameters)
            starts_known = self._known is not None or self._start is not None
            self._nodes.replace_newest(self._by_parts.placed(self.log, self.state.nodes, self.parameters, starts_known))

    def _search_beside_scan_before(self, covariance: np.ndarray) -> None:
        """Put the newest node where its scan fits to the scans before; covariance: of the node before it."""
        first = self.submaps.start
        self.state.nodes[-1] = searched_node(self.solution, covariance, first)

    def _join(self, estimate: LiveEstimate) -> bool:
        """Put the newest scans, which lie apart, into the map if they fit at one place; return whether they did."""
        covariance = estimate.covariance[:2, :2]
        self.search = submap_place(self.solution, covariance)
        if self.search.is_certain:
            self._move(self.search.moves)
            self.submaps.join()
        return self.search.is_certain

    def _move(self, moves: np.ndarray) -> None:
        """Move the newest nodes by `moves` (k, width)."""
        self.state.nodes[-len(moves) :] += moves


def _name_of(odometry: OdometryModel) -> np.ndarray:
    """Return the name of a model (n,) uint8, as a map's file keeps it: models of equal width mean other unknowns."""
    return np.frombuffer(type(odometry).__name__.encode(), dtype=np.uint8)
