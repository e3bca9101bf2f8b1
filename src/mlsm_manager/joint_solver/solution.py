"""A run as far as it is solved: what was measured, the unknowns, and what follows from both."""

from dataclasses import dataclass, field, replace
from typing import Dict, List, Mapping, Optional, Tuple, Union

import numpy as np

from mlsm_manager.joint_solver.compiled_comparisons import Pairs
from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.motion_models import OdometryModel
from mlsm_manager.joint_solver.normal_equations import DELAY, RANGE_SCALE, YAW, Layout, NormalEquations, State
from mlsm_manager.joint_solver.odometry_log import OdometryLog
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import NO_POINTS, PlacedPoints, path_rows, placed_rows
from mlsm_manager.joint_solver.prior_mixture import PriorTerm
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.surface_points import SurfacePoints
from mlsm_manager.scan_matching.scan import MapCloud, Scan
from node_support.geometry import inverse, transformed

_HALF_SECOND = 0.5  # the velocity of a point is averaged over one second, longer than the odometry's period
MAP = 0  # the submap of all scans whose place in the map is known


class Submaps:
    """Which scans are compared with each other: those after a silence wait apart until their place in the map is known.

    Every scan of a run has the number of its submap; a new one begins where nobody knows where the vehicle is.
    """

    def __init__(self, numbers: np.ndarray) -> None:
        """numbers: (n,) of the scans so far."""
        self._numbers: List[int] = [int(number) for number in numbers]
        self._begun = max(self._numbers, default=MAP)

    @property
    def numbers(self) -> np.ndarray:
        """(n,) int, the submap of each scan."""
        return np.array(self._numbers, dtype=np.int64)

    @property
    def newest(self) -> int:
        """The submap of the newest scan; that of the map where there is none."""
        return self._numbers[-1] if self._numbers else MAP

    @property
    def is_apart(self) -> bool:
        """Whether the place of the newest scan in the map is not known."""
        return self.newest != MAP

    @property
    def apart(self) -> np.ndarray:
        """(n,) bool, whether the place of a scan in the map is not known."""
        return self.numbers != MAP

    @property
    def start(self) -> int:
        """The first scan that the newest one is compared with."""
        return self._numbers.index(self.newest) if self.is_apart else 0

    def append(self) -> None:
        self._numbers.append(self.newest)

    def shorten(self, count: int) -> None:
        del self._numbers[count:]

    def begin(self) -> None:
        """Let the newest scan begin a submap of its own."""
        self._begun += 1
        self._numbers[-1] = self._begun

    def join(self) -> None:
        """Put the newest submap into the map, because its place is known now."""
        joined = self.newest
        self._numbers = [MAP if number == joined else number for number in self._numbers]

    def within(self, pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints) -> Pairs:
        """Return the comparisons of points of one submap; what was in the map before the run is of the map."""
        scans = sources.scans[pairs.rows], targets.scans[pairs.neighbours]
        own, other = (np.where(each < 0, MAP, self.numbers[each]) for each in scans)
        return Pairs(*(each[own == other] for each in pairs))


_NODES, _PLACES, _INFORMATION = "fix_nodes", "fix_places", "fix_information"  # the names in stored maps


@dataclass(frozen=True)
class Fix:
    """Where a single scan was found in the map, while the solver itself hardly knows how far the vehicle goes.

    place: (2,) m in map at the end of the scan. information: (2, 2) its inverse covariance. The compass tells yaw.
    """

    place: np.ndarray
    information: np.ndarray

    @classmethod
    def without_prior(
        cls, place: np.ndarray, covariance: np.ndarray, expected: np.ndarray, prior_covariance: np.ndarray
    ) -> "Fix":
        """Return what a scan itself says, if `place` (2,) with its covariance (2, 2) also holds what was expected."""
        of_both, of_prior = np.linalg.inv(covariance), np.linalg.inv(prior_covariance)
        values, vectors = np.linalg.eigh(of_both - of_prior)
        information = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T
        return cls(np.linalg.pinv(information) @ (of_both @ place - of_prior @ expected), information)


class Fixes(Dict[int, Fix]):
    """Those of a run, by the node at the end of the scan."""

    def add(self, equations: NormalEquations, layout: Layout, poses: np.ndarray, corrections: np.ndarray) -> None:
        """Add those of the free nodes. poses: (n, 3) T_odom_base, corrections: (n, width), of these nodes."""
        for node, fix in self.items():
            if layout.first <= node <= layout.last:
                row = node - layout.first
                gradient = fix.information @ (poses[row, :YAW] + corrections[row, :YAW] - fix.place)
                columns = layout.node_start(node) + np.arange(YAW)
                equations.add_terms(columns[np.newaxis], fix.information[np.newaxis], gradient[np.newaxis])

    def stored(self) -> Dict[str, np.ndarray]:
        """Return what `of_arrays` needs, by name."""
        return {
            _NODES: np.array(list(self), dtype=np.int64),
            _PLACES: np.array([fix.place for fix in self.values()]).reshape(-1, YAW),
            _INFORMATION: np.array([fix.information for fix in self.values()]).reshape(-1, YAW, YAW),
        }

    @classmethod
    def of_arrays(cls, stored: Mapping[str, np.ndarray]) -> "Fixes":
        """Return what was `stored`. Raises KeyError."""
        arrays = (stored[name] for name in (_NODES, _PLACES, _INFORMATION))
        return cls({int(node): Fix(place, information) for node, place, information in zip(*arrays)})


@dataclass(frozen=True)
class Solution:
    """What is passed, solved, drawn, stored and judged.

    state: the unknowns of the run in `log`. submaps: which of its scans are compared with each other. known: surfaces
    that were in the map before the run. prior_term: what a mixture of priors added to the newest node; None before.
    fixes: of single scans.
    """

    log: RunLog
    parameters: SolverParameters
    state: State
    submaps: Submaps = field(default_factory=lambda: Submaps(np.empty(0)))
    known: Optional[KnownSurfaces] = None
    prior_term: Optional[PriorTerm] = None
    fixes: Fixes = field(default_factory=Fixes)

    def with_state(self, state: State) -> "Solution":
        return replace(self, state=state)

    def since(self, scan: int) -> "Solution":
        """Return `scan` and all later ones as a run that begins with it, without what was known before."""
        state = State(self.state.nodes[scan:].copy(), self.state.run.copy())
        state.nodes[:, :YAW] -= state.nodes[0, :YAW]
        return Solution(self.log.since(scan), self.parameters, state, Submaps(self.submaps.numbers[scan:]))

    def placed(self, heard: Tuple[SurfacePoints, np.ndarray]) -> PlacedPoints:
        """Return points and the scan of each, as the log's tables have them, in the map.

        They follow from the path between the two nodes of the scan that heard each.
        """
        (points, scans), log, state = heard, self.log, self.state
        if not len(scans):
            return NO_POINTS
        times = points.times + state.run[DELAY]
        nodes = np.unique(np.concatenate([scans, scans + 1]))
        sights = times, np.searchsorted(nodes, scans), points.ranges, points.bearings
        around = times.min() - _HALF_SECOND, times.max() + _HALF_SECOND
        legs, knots = _path(log.odometry, self.parameters.odometry, log.node_times[nodes], state.nodes[nodes], around)
        scale = float(state.run[RANGE_SCALE])
        found = placed_rows(sights, points.normals, log.sonar_in_base, scale, legs, knots, _HALF_SECOND)
        return PlacedPoints(
            scans=scans, places=found[:, 0:2], arms=found[:, 2:4], normals=found[:, 4:6], slants=points.slants,
            qualities=points.qualities, shares=found[:, 10], by_run=found[:, 6:10].reshape(-1, 2, 2),
        )  # fmt: skip

    @property
    def places(self) -> np.ndarray:
        """Where all nodes are, (n, 2) m in map."""
        return self.node_places(np.arange(len(self.state.nodes)))

    def node_places(self, nodes: np.ndarray) -> np.ndarray:
        """Return where `nodes` (...) of the run are, (..., 2) m in map."""
        return self.log.node_poses(nodes)[..., :2] + self.state.nodes[nodes, :2]

    def heard(self, cloud: Union[MapCloud, Scan]) -> Tuple[np.ndarray, np.ndarray]:
        """Return the points (n, >= 2) of a cloud in map, and where the sonar was when it heard each, (n, 2) m.

        Ranges and stamps are corrected as the run's unknowns say. Before the first node and after the last one the
        motion goes on.
        """
        seen = transformed(inverse(self.log.odometry.at(cloud.times)), cloud.points)
        sonar = self.log.sonar_in_base
        seen[:, :2] = sonar + (1.0 + self.state.run[RANGE_SCALE]) * (seen[:, :2] - sonar)
        path = self.path(cloud.times + self.state.run[DELAY])
        return transformed(path, seen), transformed(path, np.broadcast_to(sonar, (len(path), 2)))

    def path(self, times: np.ndarray) -> np.ndarray:
        """Return T_map_base (m, 3) at `times` (m,) [s]."""
        return solved_path(self.log.odometry, self.parameters.odometry, self.log.node_times, self.state.nodes, times)


def solved_path(
    log: OdometryLog, odometry: OdometryModel, node_times: np.ndarray, nodes: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Return T_map_base (m, 3) at any `times` (m,) [s]; before the first node and after the last as it goes on.

    node_times: (n,) s, n > 1. nodes: (n, width).
    """
    if not len(times):
        return np.empty((0, 3))
    first, last = np.searchsorted(node_times, [times.min(), times.max()])
    near = slice(max(min(first, len(node_times) - 1) - 1, 0), last + 1)
    node_times, nodes = node_times[near], nodes[near]
    around = min(times.min(), node_times[-1]), max(times.max(), node_times[0])
    return path_rows(times, *_path(log, odometry, node_times, nodes, around))


def _path(
    log: OdometryLog, odometry: OdometryModel, times: np.ndarray, nodes: np.ndarray, around: Tuple[float, float]
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the nodes (n, 8), and poses of the odometry between two times (k, 4), as compiled loops take them.

    times: (n,) s. nodes: (n, width). Between two nodes the path is the model's reference path, which is even between
    the poses, turned and scaled by the mean of both gains, and stretched to lead from one to the other. The last gain
    is that with which it goes on.
    """
    motion, known = log.path(times, *around)
    places, gain = motion.poses[:, :2] + nodes[:, :2], odometry.gain(nodes)
    gain[:-1] = (gain[:-1] + gain[1:]) / 2.0
    at_nodes, at_poses = ((path.real, path.imag) for path in (odometry.reference(motion), odometry.reference(known)))
    return (
        np.column_stack([times, places, nodes[:, YAW], *at_nodes, gain.real, gain.imag]),
        np.column_stack([known.times, known.poses[:, YAW], *at_poses]),
    )
