"""One run of the joint solver in the map, and what its estimates mean for the localiser."""

from dataclasses import dataclass, field, replace
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np
from scipy.linalg import block_diag

from mlsm_manager.joint_solver.estimate import LiveEstimate, Turns
from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.map_support import shares_heard_before
from mlsm_manager.joint_solver.normal_equations import POSE_COLUMNS, RUN_COLUMNS
from mlsm_manager.joint_solver.odometry_trials import with_odometry
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.rival_solvers import RivalSolvers
from mlsm_manager.joint_solver.solution import Fix, Solution
from mlsm_manager.localisation.clouds import PATH_POINTS
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import Belief, Fading, MapCloud, MatchResult, MatchStatus, Scan, Track
from mlsm_manager.scan_matching.scan_path import ERRORS, POSE, STATES
from mlsm_manager.self_check.map_checks import AGREES, in_submaps, recent_agreement, scans_go_on, surfaces_tell
from mlsm_manager.self_check.path_checks import odometry_decided, position_uncertainty
from mlsm_manager.self_check.verdict import Verdict
from node_support.geometry import composed, transformed

_LONGEST_PAUSE = 2.0  # usual durations of a scan between two scans: fewer may be a turn that was lost
_MOST_STORED = 200  # scans of a run that are stored with each save: about an hour, and some megabytes
_MOST_SCANS = 30  # for one pause, which bounds the time that it costs; in longer ones they are farther apart
_CHECKED_SCANS = 20  # that are checked for their agreement with the map: about the window of the solver
_BEFORE = 10.0  # s of odometry before a run, by which its first beams may be late
_MOST_APART = 200  # scans of unknown place that may still be moved: an hour's, since all of them are drawn anew


@dataclass
class JointSession:
    """One run. T_map_odom: (3,) at its beginning; scans are moved by it, so that corrections stay small.

    scans: all that it took, as they came, and scans without echoes for pauses; none after a long run.
    """

    rivals: RivalSolvers
    T_map_odom: np.ndarray
    scans: List[Scan] = field(default_factory=list)
    _taken: int = 0
    _shares: Dict[int, float] = field(default_factory=dict)

    @property
    def solver(self) -> LiveSolver:
        """The solver that is believed."""
        return self.rivals.shown

    def add(self, scan: Scan, fix: Optional[Fix] = None) -> LiveEstimate:
        """Take the next scan, and scans without echoes for a pause before it; see LiveSolver.add."""
        for silent in _scans_of_pause(scan, self.solver.log.node_times):
            self._add(silent)
        return self._add(scan, fix)

    def _add(self, scan: Scan, fix: Optional[Fix] = None) -> LiveEstimate:
        estimate = self.rivals.add(moved(scan, self.T_map_odom), fix)
        self._taken += 1
        self.scans.append(scan)
        if self._taken > _MOST_STORED:
            self.scans.clear()
        return estimate

    @classmethod
    def resumed(
        cls,
        parameters: SolverParameters,
        sonar_in_base: np.ndarray,
        T_map_odom: np.ndarray,
        scans: Sequence[Scan],
        stored: Mapping[str, np.ndarray],
    ) -> "JointSession":
        """Return a run that goes on after `scans`; see LiveSolver.resumed."""
        placed = [moved(scan, T_map_odom) for scan in scans]
        return cls(RivalSolvers.resumed(parameters, sonar_in_base, placed, stored), T_map_odom, list(scans), len(scans))

    @classmethod
    def begun(
        cls,
        parameters: SolverParameters,
        sonar_in_base: np.ndarray,
        T_map_odom: np.ndarray,
        start: Optional[np.ndarray],
        known: np.ndarray,
    ) -> "JointSession":
        """Return a new run in a map of blocks with means at `known` (n, 2) m; `start`: see LiveSolver."""
        surfaces = KnownSurfaces(known) if len(known) else None
        return cls(RivalSolvers.begun(parameters, sonar_in_base, start, surfaces), T_map_odom)

    def solved_with(self, parameters: SolverParameters) -> "JointSession":
        other = JointSession(self.rivals.begun_with(parameters), self.T_map_odom)
        for scan in self.scans:
            other._add(scan)
        return other

    @property
    def unsure_of_map(self) -> np.ndarray:
        """(2, 2) m^2, covariance of the newest scans' places in the map: one drawn wrongly confirms itself.

        A single scan lies right in its own map.
        """
        newest = self.solver.estimates[-1]
        return newest.covariance[:2, :2] if self.solver.log.scan_count > 1 else np.zeros((2, 2))

    @property
    def may_be_stored(self) -> bool:
        """Whether `scans` are all that were taken: not after a long run."""
        return len(self.scans) == self._taken

    def verdicts(self) -> List[Verdict]:
        """Return how the newest scans agree with the map and each other, and how far the newest place is known."""
        parts = self.solver.parameters.parts_per_turn
        newest = slice(-_CHECKED_SCANS * parts, None)
        estimates, apart = self.solver.estimates, self.solver.submaps.apart
        turns = Turns.of(estimates[newest], apart[newest], parts)
        heard = Turns.with_echoes(estimates, apart, parts, self.solver.log.surfaces.counts, _CHECKED_SCANS)
        begin = self.start if len(turns.times) else np.nan
        found = [*self._going_on(turns.times), recent_agreement(heard.times, heard.agreements, _CHECKED_SCANS)]
        if len(turns.times) > 1:  # the first one alone does not tell its own speed
            time, stated = np.array([estimates[-1].time]), np.array([estimates[-1].stated_deviation])
            found.append(position_uncertainty(time, stated, self.solver.expected_deviations(estimates[-1:])))
        return [
            *found,
            *surfaces_tell(begin, turns.times, turns.surfaces, self.solver.distance_deviation),
            *in_submaps(turns.times, turns.apart),
            *odometry_decided(self.rivals.doubt),
        ]

    def _going_on(self, times: np.ndarray) -> Tuple[Verdict, ...]:
        """Ask whether the newest turns, which ended at `times` (n,) [s], lie on those before them.

        Of each it is found once: the solver may move a turn later, but hardly against those just before it.
        """
        solver, parameters = self.solver, self.solver.parameters
        if not np.isinf(solver.odometry.distance_deviation):
            return ()
        count = solver.log.scan_count // parameters.parts_per_turn
        newest = range(count - len(times), count)
        first = max(newest.start, max(self._shares, default=-1) + 1)
        found = shares_heard_before(solver.solution, first)
        known = {**self._shares, **dict(zip(range(first, count), found))}
        self._shares = {turn: known[turn] for turn in newest}
        return (scans_go_on(times, np.array([self._shares[turn] for turn in newest])),)

    @property
    def is_provisional(self) -> bool:
        """Whether the map hangs on scans of an unknown velocity, none of which agrees with another yet."""
        if not np.isinf(self.solver.odometry.distance_deviation):
            return False
        first = self.solver.estimates[:_CHECKED_SCANS]
        return all(estimate is not None and estimate.agreement < AGREES for estimate in first)

    def copied(self) -> "JointSession":
        """Return a copy; what it learns the original does not."""
        rivals = self.rivals
        sonar = self.solver.log.sonar_in_base
        return self.resumed(rivals.parameters, sonar, self.T_map_odom, self.scans, rivals.stored())

    def newest_run(self, turns: int) -> Solution:
        """Return the newest turns of the head as a run of their own, which shares nothing with this one."""
        log, parts = self.solver.log, self.solver.parameters.parts_per_turn
        run = self.solver.solution.since(max(log.scan_count - turns * parts, 0))
        return with_odometry(run, log.odometry.track_from(run.log.node_times[0] - _BEFORE))

    def follow(self, track: Track, time: float) -> None:
        """Learn the odometry up to `time` [s], which `track` holds."""
        self.solver.log.odometry.extend(_moved_track(track, self.T_map_odom), time)

    def heard(self, cloud: MapCloud) -> Tuple[np.ndarray, np.ndarray]:
        """Return the points (n, 4) of a cloud in map, and where the sonar was when it heard each, (n, 2) m."""
        return self.solver.solution.heard(replace(cloud, points=transformed(self.T_map_odom, cloud.points)))

    def path(self, times: np.ndarray) -> np.ndarray:
        """Return T_map_base (m, 3) at `times` (m,) [s]."""
        return self.solver.solution.path(times)

    @property
    def start(self) -> float:
        """Time [s] from which on the run knows the odometry; it begins with the first scan."""
        return float(self.solver.log.node_times[0])

    @property
    def known_until(self) -> float:
        """Time [s] of the newest node."""
        return float(self.solver.log.node_times[-1])

    @property
    def settled_until(self) -> float:
        """Time [s] of the oldest node that may still move: scans that lie apart move when their place is found."""
        times = self.solver.log.node_times
        newest = len(times) - 1
        still = times[max(0, newest - self.solver.parameters.free_nodes)]
        return float(min(still, max(self.apart_from, times[max(0, newest - _MOST_APART)])))

    @property
    def apart_from(self) -> float:
        """Time [s] from which on nobody knows how the scans lie to the map; infinity where it is known of all."""
        submaps = self.solver.submaps
        return float(self.solver.log.node_times[submaps.start]) if submaps.is_apart else np.inf

    @property
    def turns_apart(self) -> int:
        """Number of turns of the head that nobody knows the place of in the map."""
        return int(self.solver.submaps.apart.sum()) // self.solver.parameters.parts_per_turn


def _scans_of_pause(scan: Scan, node_times: np.ndarray) -> List[Scan]:
    """Return scans without points from the newest of node_times (n,) [s] to the beginning of `scan`, n > 0.

    None where that is less than a pause, and before a scan without echoes, whose beginning is not known. The last one
    ends where the scan begins: the vehicle's motion within that does not hang on the one in the pause.
    """
    if len(node_times) < 2:
        return []
    newest, start, usual = node_times[-1], scan.start, float(np.median(np.diff(node_times)))
    if start - newest <= _LONGEST_PAUSE * usual:
        return []
    count = min(round((start - newest) / usual), _MOST_SCANS)
    ends = np.linspace(newest, start, count + 1)[1:].tolist()
    return [scan.without_points(end) for end in ends if end < scan.reference_time]


def moved(scan: Scan, T_map_odom: np.ndarray) -> Scan:
    """Return a scan as an odometry places it whose frame lies at `T_map_odom` (3,) in the one before."""
    track = _moved_track(scan.track, T_map_odom)
    return replace(scan, points=transformed(T_map_odom, scan.points), track=track)


def _moved_track(track: Track, T_map_odom: np.ndarray) -> Track:
    if not T_map_odom.any():
        return track
    return track.with_poses(composed(T_map_odom, track.poses))


def belief_of(estimate: LiveEstimate, errors: OdometryErrors, fading: Optional[Fading]) -> Belief:
    """Return pose and odometry errors; of errors that the solver does not estimate, what is known beforehand.

    fading: of the rates after the estimate.
    """
    drift = estimate.drift
    slopes = np.zeros((STATES, estimate.node.size))
    slopes[:POSE_COLUMNS, :POSE_COLUMNS] = np.eye(POSE_COLUMNS)
    slopes[ERRORS] = drift.slopes
    of_node = estimate.covariance[:-RUN_COLUMNS, :-RUN_COLUMNS]
    covariance = slopes @ of_node @ slopes.T
    unknown = ~slopes.any(axis=1)
    covariance[unknown, unknown] = np.diag(errors.covariance())[unknown]
    return Belief(estimate.time, np.append(estimate.T_map_base, drift.values), covariance, fading)


def belief_at(time: float, pose: np.ndarray, errors: OdometryErrors) -> Belief:
    """Return a belief in a pose (3,) that is taken as certain, with odometry errors as they are beforehand."""
    return Belief(time, np.concatenate([pose, np.zeros(STATES - POSE_COLUMNS)]), errors.covariance())


def belief_of_match(scan: Scan, result: MatchResult, errors: OdometryErrors) -> Belief:
    """Return a belief in the pose that a match found, with odometry errors as they are beforehand."""
    belief = belief_at(scan.reference_time, result.pose, errors)
    belief.covariance[POSE, POSE] = result.covariance[POSE, POSE]
    return belief


def expected_at(correction: np.ndarray, scan: Scan, expected: Belief) -> Belief:
    """Return the belief that `correction` T_map_odom (3,) puts the end of a scan rightly, as sure as `expected`."""
    theta = np.concatenate([composed(correction, scan.reference_pose), expected.theta[POSE_COLUMNS:]])
    return Belief(scan.reference_time, theta, expected.covariance)


def update_of(scan: Scan, session: JointSession, belief: Belief, seconds: float) -> ScanUpdate:
    """Return what a run that has just taken a scan made of it: no fix where none of its points met another.

    seconds: that it took.
    """
    solver = session.solver
    estimate, parts = solver.estimates[-1], solver.estimates[-solver.parameters.parts_per_turn :]
    points = [part.comparisons for part in parts]
    if not any(points):
        return ScanUpdate(scan, None, True, belief, provisional=session.is_provisional)
    # What pose and velocity share is left out.
    covariance = block_diag(estimate.pose_covariance, estimate.velocity_covariance)
    times = np.linspace(min(scan.start, estimate.time - 1e-3), estimate.time, PATH_POINTS)
    result = MatchResult(
        status=MatchStatus.CONVERGED, belief=belief, velocity=estimate.velocity, covariance=covariance,
        error=float(np.average([part.distance for part in parts], weights=points)), points_used=sum(points),
        seconds=seconds, beam_times=times, beam_poses=session.path(times),
    )  # fmt: skip
    return ScanUpdate(scan, result, True, belief, solver.found, session.is_provisional, loop=solver.closed)
