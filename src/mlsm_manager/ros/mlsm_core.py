"""The ROS side of the map: clouds and echoes in; map, fix, map -> odom and services out (thesis 4.5.1, 6.5.6)."""

import threading
from typing import Optional

import numpy as np
import rospy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from mlsm_manager.localisation.live_correction import LiveCorrection
from mlsm_manager.localisation.mapper import CloudUpdate, Mapper, ScanUpdate
from mlsm_manager.localisation.parameters import MapInput, MatchInput, MlsmCoreParameters
from mlsm_manager.localisation.relocalisation import relocalised, relocaliser
from mlsm_manager.localisation.sensor_model import trusted
from mlsm_manager.localisation.update_report import tell_cloud, tell_scan
from mlsm_manager.matching.matchers.parameters import DistributionMatcherParameters
from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.matching.problem.scan import Scan, Track
from mlsm_manager.ros.fix_publisher import FixPublisher
from mlsm_manager.ros.map_publisher import MapPublisher
from mlsm_manager.ros.map_transform import MapTransform
from mlsm_manager.ros.odometry_track import OdometryTrack
from mlsm_manager.surface_map.storage import map_path, write_ply
from node_support import topics
from node_support.errors import RefusedInput
from node_support.geometry.planar import matrices
from node_support.ros.node import every, guarded, make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.conversions import StampedIntensityCloudArrays, cloud_from_message
from sonar_processing.ros.subscribers import subscribe_to_clouds
from underwater_map_construction.srv import SaveMap, SaveMapRequest, SaveMapResponse

_JUMP_BACK = 30.0
_LONGEST_SILENCE = 60.0


class MlsmCore:
    """Inserts clouds into the map, matches scans with it, and keeps the world informed of both."""

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health("mlsm_core")
        self.healths = [self.health]
        self._lock = threading.RLock()
        self._changed = False
        self._stamp_ns = 0
        self._live = ReconfigurableParameters(
            MlsmCoreParameters, namespace, "MlsmCore", self.health, self._use_parameters
        )
        parameters = self._live.current
        self._odometry = OdometryTrack(
            parameters.odom_frame, parameters.base_frame, self.health, parameters.stamp_tolerance
        )
        self._publisher = MapPublisher(parameters.map_frame)
        self._fix = FixPublisher(parameters.map_frame, parameters.base_frame)
        self._transform = MapTransform(lambda: self._live.current, self._correction, self.health)
        prefix = namespace if namespace == "~" else namespace + "/"
        rospy.Service(f"{prefix}save_map", SaveMap, self._save)
        rospy.Service(f"{prefix}reset", Trigger, self._reset)
        rospy.Service(f"{prefix}relocalise", Trigger, self._relocalise)
        rospy.Subscriber(topics.START_MATCHING, Bool, guarded(self.health, self._start_matching), queue_size=10)
        every(parameters.map_period, self._publish_if_changed, self.health)

    @classmethod
    def as_node(cls) -> "MlsmCore":
        """Return the map as a node of its own, which takes clouds and echoes from their topics."""
        core = cls()
        core.subscribe()
        return core

    def subscribe(self) -> None:
        """Take clouds from sonar/scan/cleaned and scans of echoes from sonar/scan/echoes."""

        def take(message: StampedIntensityCloudArrays) -> None:
            self.insert(cloud_from_message(message))

        def take_echoes(message: StampedIntensityCloudArrays) -> None:
            self.match(cloud_from_message(message))

        subscribe_to_clouds(topics.CLEANED, guarded(self.health, take))
        subscribe_to_clouds(topics.ECHOES, guarded(self.health, take_echoes))

    def insert(self, cloud: IntensityCloud) -> None:
        """Insert a cloud; one that cannot be placed in the map is counted and left out."""
        guarded(self.health, self._insert)(cloud)

    def match(self, cloud: IntensityCloud) -> None:
        """Match a scan of echoes; one that cannot be matched is counted."""
        if self._live.current.match_input is MatchInput.ECHOES:
            guarded(self.health, self._match)(cloud)

    def _use_parameters(self, parameters: MlsmCoreParameters) -> None:
        with self._lock:
            if not hasattr(self, "_mapper"):
                self._correcting = LiveCorrection(parameters.blend_time)
                self._mapper = Mapper(
                    parameters.settings(), parameters.part(OdometryErrors), parameters.build_matcher()
                )
                self._mapper.matching = parameters.start_matching
            self._mapper.matcher = parameters.build_matcher()
            self._correcting.blend_time = parameters.blend_time

    def _start_matching(self, message: Bool) -> None:
        with self._lock:
            changed = self._mapper.matching != message.data
            self._mapper.matching = message.data
        if changed:
            rospy.loginfo("%s: matching is %s", self.health.name, "on" if message.data else "off")

    def _insert(self, cloud: IntensityCloud) -> None:
        self.health.count("clouds in")
        self.health.count("points in", len(cloud))
        self._check(cloud)
        if cloud.broken:
            kind, detail = "points that are not finite", f"{cloud.broken} of {len(cloud)} in a cloud"
            self.health.problem(kind, detail, cloud.broken)
        if self._live.current.match_input is MatchInput.CLEANED and cloud.frame_id != self._live.current.map_frame:
            guarded(self.health, self._match)(cloud)
        if self._live.current.map_input is MapInput.CLEANED:
            with self.health.timed(), self._lock:
                self._notice_jump(cloud.stamp_ns * 1e-9)
                self._tell_map(self._insert_here(cloud), cloud.stamp_ns)

    def _insert_here(self, cloud: IntensityCloud) -> CloudUpdate:
        if cloud.frame_id == self._live.current.map_frame:
            return CloudUpdate(self._mapper.shown.insert(cloud.points[cloud.valid]), False, 0)
        time = cloud.stamp_ns * 1e-9
        nowhere = Track(np.array([time]), np.zeros((1, 3)))
        return self._mapper.take_cloud(Scan.from_stamps(cloud.points, cloud.time_stamps, time, nowhere))

    def _check(self, cloud: IntensityCloud) -> None:
        self._odometry.check_stamp(cloud.stamp_ns)
        parameters = self._live.current
        if cloud.frame_id not in (parameters.odom_frame, parameters.map_frame):
            raise RefusedInput(
                "clouds refused",
                f"frame {cloud.frame_id!r}, must be {parameters.odom_frame!r} or {parameters.map_frame!r}; "
                "set sonar_to_cloud's target_frame",
            )

    def _match(self, cloud: IntensityCloud) -> None:
        self.health.count("scans in")
        self._check(cloud)
        self._notice_jump(cloud.stamp_ns * 1e-9)
        scan = self._scan(cloud)
        if scan is None:
            return
        with self._lock:
            update = self._mapper.take_echoes(scan)
            self._correcting.believe(update.belief)
            if self._live.current.map_input is MapInput.MATCHED:
                self._tell_map(self._mapper.take_cloud(scan), cloud.stamp_ns)
            for waited in iter(self._mapper.take_waiting, None):
                self._tell_map(waited, cloud.stamp_ns)
        tell_scan(self.health, update, self._mapper.matching)
        self._publish_fix(update, cloud.stamp_ns)

    def _tell_map(self, update: CloudUpdate, stamp_ns: int) -> None:
        self._stamp_ns = stamp_ns
        self._changed = True
        tell_cloud(self.health, update, len(self._mapper.shown), self._live.current.map_limit)

    def _scan(self, cloud: IntensityCloud) -> Optional[Scan]:
        time, times = cloud.stamp_ns * 1e-9, np.unique(np.abs(cloud.time_stamps[cloud.valid]))
        belief = self._mapper.belief
        start = min([time, *times[:1], *([] if belief is None else [belief.time])])
        try:
            track = self._odometry.track(start, times, time)
        except RefusedInput:
            self.health.count("scans not used")
            if self._mapper.matching:
                raise
            return None
        scan = Scan.from_stamps(cloud.points, cloud.time_stamps, time, track)
        return trusted(scan, self._live.current.edge_half_width)

    def _publish_fix(self, update: ScanUpdate, stamp_ns: int) -> None:
        if update.result is None or not update.accepted:
            return
        T_map_odom = matrices(update.result.correction(update.scan))
        T_map_base = T_map_odom @ self._odometry.matrix(update.scan.reference_time)
        self._fix.publish(update.result, T_map_base, stamp_ns)

    def _correction(self) -> np.ndarray:
        newest = self._odometry.newest()
        if newest is None:
            return self._mapper.correction
        time, pose = newest
        self._notice_jump(time)
        belief = self._mapper.belief
        if belief is not None and time - belief.time > _LONGEST_SILENCE:
            track = self._odometry.track(belief.time, np.empty(0), time)
            with self._lock:
                self._mapper.follow(track, time)
        return self._correcting.sample(time, pose)

    def _notice_jump(self, time: float) -> None:
        belief = self._mapper.belief
        if belief is None or time >= belief.time - _JUMP_BACK:
            return
        with self._lock:
            self._mapper.forget_place()
            self._correcting.clear()
            self._odometry.clear()
        detail = f"by {belief.time - time:.1f} s; the map stays, the place in it begins at odom again"
        self.health.problem("jumps back in time", detail)

    def _publish_if_changed(self) -> None:
        with self._lock:
            if not self._changed:
                return
            blocks, stamp_ns, self._changed = self._mapper.shown.blocks, self._stamp_ns, False
        self._publisher.publish(blocks, stamp_ns)

    def _reset(self, _request: TriggerRequest) -> TriggerResponse:
        with self._lock:
            count = len(self._mapper.shown)
            self._mapper.clear()
            self._correcting.clear()
            self._fix.clear()
            self._changed = True
        return TriggerResponse(True, f"{count} blocks forgotten")

    def _relocalise(self, _request: TriggerRequest) -> TriggerResponse:
        with self._lock:
            scan = self._mapper.newest
            if scan is None:
                return TriggerResponse(False, "no scan yet")
            parameters = self._live.current
            matcher = relocaliser(parameters.as_wide_as_heard().part(DistributionMatcherParameters))
            result = relocalised(scan, self._mapper.matched.blocks, matcher, self._mapper.errors)
            if not result.accepted:
                return TriggerResponse(False, f"{result.status.value}: {result.reason}")
            update = self._mapper.adopt(scan, result)
            self._correcting.believe(update.belief)
        self._publish_fix(update, int(scan.reference_time * 1e9))
        x, y, yaw = result.pose
        return TriggerResponse(True, f"at x {x:.2f} m, y {y:.2f} m, yaw {np.degrees(yaw):.1f} deg in map")

    def _save(self, request: SaveMapRequest) -> SaveMapResponse:
        with self._lock:
            blocks = self._mapper.shown.blocks
        try:
            path = map_path(self._live.current.save_folder, request.name)
            write_ply(path, blocks)
        except (OSError, ValueError) as error:
            return SaveMapResponse(False, str(error))
        return SaveMapResponse(True, f"{len(blocks)} blocks written to {path}")
