"""The joint solver as an estimator: scans in, a map drawn from keyframes and the vehicle's place in it out."""

from time import perf_counter
from typing import Mapping, NamedTuple, Optional, Sequence

import numpy as np

from mlsm_manager.joint_solver.live_solver import ODOMETRY, name_of
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.solution import Fix
from mlsm_manager.localisation.clouds import PATH_POINTS
from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.localisation.joint_session import (
    JointSession,
    belief_at,
    belief_of,
    belief_of_match,
    expected_at,
    update_of,
)
from mlsm_manager.localisation.keyframe_map import MapSettings
from mlsm_manager.localisation.resumption import StoredRun, resumed_if_it_fits
from mlsm_manager.localisation.updates import NOTHING_INSERTED, CloudUpdate, ScanUpdate
from mlsm_manager.odometry.continuous import ReportedMotion
from mlsm_manager.scan_matching.prediction import OdometryErrors, predicted, updated_by_heading
from mlsm_manager.scan_matching.scan import Belief, MapCloud, Matcher, MatchResult, Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE, POSITION
from mlsm_manager.surface_map.blocks import Blocks, BlockSource
from mlsm_manager.surface_map.insertion import admitted
from mlsm_manager.surface_map.map_file import Layer
from node_support.geometry import composed, transformed

_KNOWN_SCALE = 0.05  # deviation of the odometry's scale below which a place is known to about the cut of the solver
_SURE = 0.5  # of an echo's deviation: a fix that is less sure says no more than the comparisons of the same echoes do
_EXPECTED = 100.0  # m: where a place is expected less surely, or overflows after a bad odometry, nothing is searched
# Of a run without reported positions, before it tells its velocity: a dead reckoning made from that changes the
# positions that are reported, and proves nothing.
_SCANS_BEFORE_VELOCITIES = 2


class Assumed(NamedTuple):
    """What is assumed of an odometry."""

    parameters: SolverParameters
    errors: OdometryErrors


class Joint(Estimator):
    """Follows the vehicle with all scans at once: the newest may still move, the older ones are the map.

    No scan of a run is rejected: one that says little moves little, and its covariance grows. While `matching` is off
    scans and clouds are placed by the odometry as corrected so far. What is in the map when a run begins, or begins
    again after a relocalisation, is a surface that its scans are compared with. A run in a stored map begins only with
    a scan that the matcher finds near the place where the vehicle is expected, and a stored run goes on with one that
    its own solver finds on the map too.
    """

    _bends = True

    def __init__(
        self, settings: MapSettings, errors: OdometryErrors, matcher: Matcher, sonar_in_base: Sequence[float],
        parameters: SolverParameters, without_positions: Optional[Assumed] = None,
    ) -> None:  # fmt: skip
        """`without_positions`: assumed where the odometry is found to report none; None where its kind was named."""
        self._usual, self._without_positions = Assumed(parameters, errors), without_positions
        super().__init__(settings, errors, matcher, sonar_in_base)

    def clear(self) -> None:
        self.session = None
        super().clear()

    def forget_place(self) -> None:
        self._end_session()
        super().forget_place()
        self._found_at = -np.inf
        self._motion = ReportedMotion()
        self.parameters, self.errors = self._usual

    @property
    def lookahead(self) -> float:
        return self.parameters.lookahead

    @property
    def odometry(self) -> str:
        if self.session is None:
            return ""
        if self._without_positions is not None and self.parameters is self._without_positions.parameters:
            return "HEADING, because positions never change"
        return self.session.rivals.told

    @property
    def target(self) -> BlockSource:
        """The map in which a lost vehicle is searched: without the newest scan and those that lie apart.

        Where the vehicle was put wrongly it would find itself.
        """
        if self.session is None:
            return super().target
        before_newest = self.session.solver.log.node_times[-2]
        return self._maps.matched.drawn_until(min(self.session.apart_from, before_newest), self.session)

    @property
    def keyframes(self) -> Mapping[str, np.ndarray]:
        """What `restore` needs to go on with the present run, as arrays; none without a run or after a long one."""
        return {} if self.session is None else self._maps.stored(self.session)

    def restore(self, layers: Mapping[Layer, Blocks], keyframes: Mapping[str, np.ndarray]) -> str:
        self._take(layers)
        run, other = StoredRun.of_arrays(keyframes), self._without_positions
        if run is None:
            return ""
        if other is not None and np.array_equal(run.solver.get(ODOMETRY, ()), name_of(other.parameters.odometry)):
            self.parameters, self.errors = other
        try:
            self.session = self._maps.resumed(run, self.parameters)
        except ValueError as error:
            self._take(layers)
            return str(error)
        self._know(run.scans[-1], self.session)
        return ""

    def add_scan(self, scan: Scan) -> ScanUpdate:
        """Find the pose of a scan together with those of the scans before it, and draw the map anew."""
        if not self.matching:
            return self._place(scan)
        return self._solve(scan) if self._expected is None else self._resume(scan, self._expected)

    def _resume(self, scan: Scan, expected: Belief) -> ScanUpdate:
        """Go on with a scan that fits to the map about where it is expected; any other is rejected.

        A stored run goes on where its solver finds the scan on the map, also if the scan alone says too little.
        """
        start = perf_counter()
        longer = None if self.session is None else resumed_if_it_fits(self.session, scan, self.matched)
        if longer is not None:
            self._expected = None
            return self._taken(scan, longer, start)
        result = self.matcher.match(scan, self.matched, expected_at(self.correction, scan, expected))
        if not result.accepted:
            return ScanUpdate(scan, result, False, self.belief)
        if self.session is None:
            return self.adopt(scan, result)
        self._expected = None
        return self._solve(scan)

    def adopt(self, scan: Scan, result: MatchResult) -> ScanUpdate:
        """Begin a new run at a pose that was found elsewhere, in the map as it is, but without scans that lie apart."""
        session = self.session
        self._end_session(np.inf if session is None else session.apart_from)
        self._expected = None
        # Nobody knows how far the odometry strayed until now: clouds from before are left out.
        self._found_at = scan.start
        self.correction = scan.correction_to(result.pose)
        self._start = np.sqrt(np.diag(result.covariance)[POSE])
        self.belief = belief_of_match(scan, result, self.errors)
        return ScanUpdate(scan, result, True, self.belief, forgotten=0 if session is None else session.turns_apart)

    def follow(self, track: Track, time: float) -> None:
        if self.session is not None and time > self.belief.time:
            self.session.follow(track, time)
        super().follow(track, time)

    @property
    def _known_until(self) -> float:
        return -np.inf if self.session is None else self.session.known_until

    def _add_matched(self, cloud: MapCloud) -> CloudUpdate:
        session = self.session
        if cloud.end <= self._found_at:
            return CloudUpdate(NOTHING_INSERTED, False, len(cloud))
        if session is not None and cloud.end <= session.start:
            return self.add_points(transformed(session.T_map_odom, cloud.points))
        if cloud.end > self._known_until:
            return self._wait(cloud)
        self._maps.shown.add(cloud)
        carved = self._maps.shown.draw(session, session.settled_until)
        _, report = admitted(cloud.points, self.settings.limit)
        return CloudUpdate(report, False, 0, carved)

    def _solve(self, scan: Scan) -> ScanUpdate:
        start = perf_counter()
        self._learn_odometry(scan)
        session = self.session
        if session is None:
            known = self.matched.blocks.mean[:, :2]
            correction = self.correction.copy()
            session = JointSession.begun(self.parameters, self.sonar_in_base, correction, self._start, known)
        session.add(scan, self._fix(scan))
        return self._taken(scan, session, start)

    def _learn_odometry(self, scan: Scan) -> None:
        """Solve the run anew if the odometry reports positions, or none, otherwise than was assumed."""
        other, session = self._without_positions, self.session
        if other is None:
            return
        self._motion.learn(scan.track)
        wanted = other if self._motion.only_turns else self._usual
        if wanted.parameters is self.parameters:
            return
        if wanted is self._usual and session is not None and session.solver.log.scan_count > _SCANS_BEFORE_VELOCITIES:
            return
        self.parameters, self.errors = wanted
        if session is None:
            return
        if session.solver.log.scan_count <= self.parameters.free_scans:
            self.session = session.solved_with(self.parameters)
        else:
            # So long the vehicle stood still: where it is in the map is known.
            self._end_session()
            self._start = np.sqrt(np.diag(self.belief.covariance)[POSE])

    def _fix(self, scan: Scan) -> Optional[Fix]:
        """Return where the scan alone lies in the map while distances are hardly known, if it is found there.

        None where echoes are plateaus: a single scan of these is metres less certain than its fit says.
        """
        session, belief = self.session, self.belief
        if session is None or belief is None or scan.reference_time <= belief.time:
            return None
        solver = session.solver
        if solver.log.has_plateaus or not _KNOWN_SCALE < solver.distance_deviation < np.inf:
            return None
        expected = predicted(belief, scan.track, scan.reference_time, self.errors)
        expected = updated_by_heading(expected, scan.reference_pose[2], self.errors.heading_deviation)
        if not np.trace(expected.covariance[POSITION, POSITION]) < _EXPECTED**2:
            return None
        result = self.matcher.match(scan, self.matched, expected)
        covariance = result.covariance[POSITION, POSITION]
        of_place = np.sqrt(np.linalg.eigvalsh(covariance + session.unsure_of_map)[-1])
        if not result.accepted or of_place > _SURE * self.parameters.echo_deviation:
            return None
        return Fix.without_prior(
            result.pose[POSITION], covariance, expected.theta[POSITION], expected.covariance[POSITION, POSITION]
        )

    def _taken(self, scan: Scan, session: JointSession, start: float) -> ScanUpdate:
        """Go on with a run that has taken a scan; `start`: s, when it began to."""
        self.session = session
        if session.solver.closed or session.rivals.switched:
            for drawn in self._maps:
                drawn.redraw(session)
        self._maps.matched.add(MapCloud.of_scan(scan))
        self._maps.matched.draw(session, session.settled_until)
        self._know(scan, session)
        return update_of(scan, session, self.belief, perf_counter() - start)

    def _know(self, scan: Scan, session: JointSession) -> None:
        solver = session.solver
        newest = solver.estimates[-1]
        self.correction = scan.correction_to(newest.T_map_base)
        self.belief = belief_of(newest, self.errors, solver.odometry.fading(newest.node))

    def _place(self, scan: Scan) -> ScanUpdate:
        self._end_session()
        pose = composed(self.correction, scan.reference_pose)
        self.belief = belief_at(scan.reference_time, pose, self.errors)
        times = np.linspace(scan.start, scan.reference_time, PATH_POINTS)
        self._history.add(times, composed(self.correction, scan.track.at(times)), scan.track, holds=True)
        self._insert_matched(transformed(self.correction, scan.points), scan.times)
        return ScanUpdate(scan, None, True, self.belief)

    def _end_session(self, until: float = np.inf) -> None:
        """End the run; what it heard after `until` [s] is forgotten."""
        if self.session is not None:
            for drawn in self._maps:
                drawn.settle(self.session, until)
        self.session = self._start = None
