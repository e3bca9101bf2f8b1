"""The joint solver as a ScanMapper: scans in, a map drawn from keyframes and the vehicle's place in it out."""

from time import perf_counter
from typing import List, Mapping, Optional

import numpy as np

from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.localisation.joint_belief import (
    belief_at,
    belief_of,
    belief_of_match,
    correction_of,
    path_times,
    prior_at,
    update_of,
)
from mlsm_manager.localisation.joint_clouds import JointClouds
from mlsm_manager.localisation.joint_maps import JointMaps
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_carving import KeyframeCarving
from mlsm_manager.localisation.map_layers import MapSettings, ShowsMaps
from mlsm_manager.localisation.map_updates import CloudUpdate, ScanUpdate
from mlsm_manager.localisation.run_continuation import continued
from mlsm_manager.localisation.stored_run import StoredRun
from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.matching.matchers.matcher_table import Matcher
from mlsm_manager.scan_matching.prediction import Belief, OdometryErrors, predicted
from mlsm_manager.scan_matching.result import MatchResult
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.blocks import Blocks, BlockSource
from mlsm_manager.surface_map.files.map_file import Layer
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import composed, transformed


class JointMapper(ShowsMaps):
    """Follows the vehicle with all scans at once: the newest may still move, the older ones are the map.

    No scan of a run is rejected: one that says little moves little, and its covariance grows. While `matching` is off
    scans and clouds are placed by the odometry as corrected so far. What is in the map when a run begins, or begins
    again after a relocalisation, is a surface that its scans are compared with. A run in a stored map begins only with
    a scan that the matcher finds near the place where the vehicle is expected, and a stored run goes on with one that
    its own solver finds on the map too.
    """

    def __init__(
        self, settings: MapSettings, errors: OdometryErrors, parameters: MultiViewParameters, matcher: Matcher,
        sonar_in_base: np.ndarray,
    ) -> None:  # fmt: skip
        """`sonar_in_base`: (2,) m; `mount` changes it."""
        self.settings = settings
        self.errors = errors
        self.parameters = parameters
        self.matcher = matcher
        self.matching = False
        self._sonar_in_base = sonar_in_base
        self._session: Optional[JointSession] = None
        self.clear()

    def clear(self) -> None:
        """Forget the map and the place in it."""
        self._session = None
        self._maps = JointMaps(self.settings)
        self.forget_place()

    def forget_place(self) -> None:
        """Keep the map but forget where the vehicle is, because time jumped."""
        self._end_session()
        self.belief: Optional[Belief] = None
        self._expected: Optional[Belief] = None
        self.correction = np.zeros(3)
        self._start: Optional[np.ndarray] = None
        self._clouds = JointClouds(self._maps.shown)

    @property
    def lookahead(self) -> float:
        """Seconds of odometry after a scan's end that it is placed better with, because beams may be late."""
        return self.parameters.window.lookahead

    def mount(self, sonar_in_base: np.ndarray) -> None:
        """Learn where the sonar is in base_link, (2,) m; it counts from the next run on."""
        self._sonar_in_base = sonar_in_base

    def verdicts(self) -> List[Verdict]:
        """Return whether the newest scans of the run agree with the map, and how uncertain its path has become."""
        return [] if self._session is None else self._session.verdicts()

    @property
    def solver(self) -> Optional[LiveSolver]:
        """The solver of the current run; None where none runs."""
        return self._session.solver if self._session is not None else None

    @property
    def target(self) -> BlockSource:
        """The map in which a lost vehicle is searched: without scans that lie apart, where it would find itself."""
        if self._session is None or np.isinf(self._session.apart_from):
            return super().target
        return self._maps.matched.drawn_until(self._session.apart_from, self._session)

    @property
    def _shown_map(self) -> MultiLevelSurfaceMap:
        return self._maps.shown.map

    @property
    def _matched_map(self) -> MultiLevelSurfaceMap:
        return self._maps.matched.map

    @property
    def _free_space(self) -> KeyframeCarving:
        return self._maps.shown.free

    @property
    def keyframes(self) -> Mapping[str, np.ndarray]:
        """What `restore` needs to go on with the present run, as arrays; none without a run or after a long one."""
        return {} if self._session is None else self._maps.stored(self._session)

    def restore(self, layers: Mapping[Layer, Blocks], keyframes: Mapping[str, np.ndarray]) -> str:
        """Take stored maps in the place of the present ones, and forget the place, or go on with stored `keyframes`.

        Return why the stored run cannot go on; nothing where it does, or where there is none. A map without a matched
        layer is matched with as it is shown. Raises ValueError, and keeps all as it is, for other resolutions than
        those of the settings.
        """
        self._take(layers)
        run = StoredRun.of_arrays(keyframes)
        if run is None:
            return ""
        try:
            session = self._maps.resumed(run, self.parameters)
        except ValueError as error:
            self._take(layers)
            return str(error)
        self._session = session
        self._know(run.scans[-1], session)
        return ""

    def _take(self, layers: Mapping[Layer, Blocks]) -> None:
        maps = JointMaps.of_layers(self.settings, layers)
        self._end_session()
        self._maps = maps
        self.forget_place()

    def start_from(self, belief: Belief, correction: np.ndarray) -> None:
        """Expect the next scan where `correction` T_map_odom (3,) puts the odometry, as sure as `belief` says."""
        self.correction = np.array(correction, dtype=np.float64)
        self._expected = belief

    def take_echoes(self, scan: Scan) -> ScanUpdate:
        """Find the pose of a scan together with those of the scans before it, and draw the map anew."""
        if not self.matching:
            return self._place(scan)
        return self._solve(scan) if self._expected is None else self._resume(scan, self._expected)

    def _resume(self, scan: Scan, expected: Belief) -> ScanUpdate:
        """Go on with a scan that fits to the map about where it is expected; any other is rejected.

        A stored run goes on where its solver finds the scan on the map, also if the scan alone says too little.
        """
        start = perf_counter()
        longer = None if self._session is None else continued(self._session, scan, self._matched_map)
        if longer is not None:
            self._expected = None
            return self._taken(scan, longer, start)
        result = self.matcher.match(scan, self._matched_map, prior_at(self.correction, scan, expected))
        if not result.accepted:
            return ScanUpdate(scan, result, False, self.belief)
        if self._session is None:
            return self.adopt(scan, result)
        self._expected = None
        return self._solve(scan)

    def adopt(self, scan: Scan, result: MatchResult) -> ScanUpdate:
        """Begin a new run at a pose that was found elsewhere, in the map as it is, but without scans that lie apart."""
        session = self._session
        self._end_session(np.inf if session is None else session.apart_from)
        self._expected = None
        self._clouds.found(scan.start)
        self.correction = result.correction(scan)
        self._start = np.sqrt(np.diag(result.covariance)[POSE])
        self.belief = belief_of_match(scan, result, self.errors)
        return ScanUpdate(scan, result, True, self.belief, forgotten=0 if session is None else session.turns_apart)

    def take_cloud(self, cloud: TimedPoints) -> CloudUpdate:
        """Put a cloud into the map that is shown, or let it wait for the scan of its time; see JointClouds."""
        if self.matching:
            return self._clouds.take(cloud, self._session)
        return self._clouds.place(cloud, self.correction, self._sonar_in_base)

    def take_placed(self, points: np.ndarray) -> CloudUpdate:
        """Insert points (n, 4) that are in map already into the map that is shown."""
        return CloudUpdate(self._maps.shown.insert(points), False, 0)

    def take_waiting(self) -> Optional[CloudUpdate]:
        """Insert or carve the next cloud that waited, if its time is known now; None when there is none."""
        known_until = -np.inf if self._session is None else self._session.known_until
        cloud = self._clouds.next_until(known_until if self.matching else np.inf)
        if cloud is not None:
            return self.take_cloud(cloud)
        if self.matching:
            # A run does not tell where the vehicle was by the odometry, with which such clouds were placed.
            self._clouds.forget_uncarved()
        return self._clouds.carve_next(self._sonar_in_base)

    def follow(self, track: Track, time: float) -> None:
        """Bring what is known to a later `time` by the odometry, where no scan did so for long."""
        if self.belief is None or time <= self.belief.time:
            return
        if self._session is not None:
            self._session.follow(track, time)
        self.belief = predicted(self.belief, track, time, self.errors)

    def _solve(self, scan: Scan) -> ScanUpdate:
        start = perf_counter()
        session = self._session
        if session is None:
            session = self._maps.begun(self.parameters, self._sonar_in_base, self.correction.copy(), self._start)
        session.add(scan)
        return self._taken(scan, session, start)

    def _taken(self, scan: Scan, session: JointSession, start: float) -> ScanUpdate:
        """Go on with a run that has taken a scan; `start`: s, when it began to."""
        self._session = session
        self._maps.matched.add(TimedPoints.of_scan(scan))
        self._maps.matched.draw(session, session.settled_until)
        self._know(scan, session)
        return update_of(scan, session, self.belief, perf_counter() - start)

    def _know(self, scan: Scan, session: JointSession) -> None:
        newest = session.solver.estimates[-1]
        self.correction = correction_of(newest.T_map_base, scan)
        self.belief = belief_of(newest, self.errors, session.solver.odometry.fading(newest.node))

    def _place(self, scan: Scan) -> ScanUpdate:
        self._end_session()
        pose = composed(self.correction, scan.reference_pose)
        self.belief = belief_at(scan.reference_time, pose, self.errors)
        self._clouds.learn_path(path_times(scan.start, scan.reference_time), self.correction, scan.track)
        origins = self._clouds.origins(scan.times, self._sonar_in_base)
        self._maps.matched.insert_cloud(transformed(self.correction, scan.points), scan.times, origins)
        return ScanUpdate(scan, None, True, self.belief)

    def _end_session(self, until: float = np.inf) -> None:
        """End the run; what it heard after `until` [s] is forgotten."""
        if self._session is not None:
            self._maps.settle(self._session, until)
        self._session = None
        self._start = None
