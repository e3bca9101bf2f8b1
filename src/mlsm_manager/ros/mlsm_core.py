"""The ROS side of the map: clouds and echoes in; map, fix, map -> odom and services out (thesis 4.5.1, 6.5.6)."""

from typing import List, Optional

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.srv import GetMap, GetMapResponse
from std_msgs.msg import Bool

from mlsm_manager.localisation.localiser import MapInput
from mlsm_manager.localisation.parameters import MatchInput, MlsmCoreParameters
from mlsm_manager.localisation.updates import (
    CloudUpdate,
    ScanUpdate,
    report_cloud,
    report_scan,
    report_steps,
    report_turn,
    report_verdicts,
)
from mlsm_manager.ros.chart_position import ChartPosition
from mlsm_manager.ros.fix_publisher import FixPublisher, MapTransform, planar_pose
from mlsm_manager.ros.map_publisher import MapPublisher
from mlsm_manager.ros.map_services import Autosave, KeptMap, MapMarks, MapServices
from mlsm_manager.ros.odometry_track import OdometryTrack, planar
from mlsm_manager.ros.status_teller import StatusTeller
from mlsm_manager.scan_matching.scan import MapCloud, Scan
from mlsm_manager.self_check.north_east_down import ZDownSigns
from node_support import topics
from node_support.errors import RefusedInput
from node_support.geometry import matrices
from node_support.health import Health
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.node import run
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters, read_parameters
from sonar_processing.beams.beam import Beam
from sonar_processing.cloud import Cloud, CloudSink
from sonar_processing.ros.beam_subscriber import BeamSubscriber
from sonar_processing.ros.cloud_topics import report_broken, subscribe_to_clouds
from sonar_processing.ros.pipeline import Pipeline
from sonar_processing.scans.parameters import SonarToCloudParameters

_Z_DOWN_ADVICE = (
    "if the odometry counts north, east, down, publish x, y left, z up instead (play_bag: ned:=true); "
    "if the head turns the other way, set head_turns"
)


class MlsmCore:
    """Converts messages for the localiser, and publishes what it answers."""

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health("mlsm_core")
        parameters = read_parameters(MlsmCoreParameters, namespace)
        self._localiser = parameters.build_localiser()
        self._longest_turn = parameters.longest_turn
        self._live = ReconfigurableParameters(MlsmCoreParameters, namespace, self.health, self._use_parameters)
        self._odometry = OdometryTrack(
            parameters.odom_frame, parameters.base_frame, self.health, parameters.stamp_tolerance
        )
        self._localiser.following.odometry.stood = self._odometry.tf.clock.stood
        self._mounted = False
        self._steps_told = 0
        self._z_down = ZDownSigns()
        kept = KeptMap(self._localiser, parameters, MapMarks(parameters.map_frame, self.health))
        self._autosave = Autosave(namespace, kept, self.health)
        self._map = MapPublisher(parameters, self._localiser, self.health)
        self._fix = FixPublisher(parameters.map_frame, parameters.base_frame)
        self._transform = MapTransform(lambda: self._live.current, self._correction, self.health)
        chart = ChartPosition(
            parameters.asked_origin, self._localiser, self._odometry, parameters.base_frame, self.health
        )
        self.status = StatusTeller(
            self._localiser, self._odometry, self._transform, chart, parameters.map_frame, self.health
        )
        # A scan of some minutes ago is placed, though tf no longer knows where the odometry was: the service succeeds.
        found = guarded(self.health, self._publish_found)
        self._services = MapServices(namespace, kept, self._after_replacing, found)
        seen = guarded(self.health, self._expect)
        rospy.Subscriber(topics.SEEN_POSE, PoseWithCovarianceStamped, seen, queue_size=10)
        rospy.Service(topics.DYNAMIC_MAP, GetMap, lambda _request: GetMapResponse(self._map.grid()))
        rospy.Subscriber(topics.START_MATCHING, Bool, guarded(self.health, self._start_matching), queue_size=10)

    @classmethod
    def as_node(cls) -> "MlsmCore":
        """Return the map as a node of its own, which takes beams, clouds and echoes from their topics."""
        core = cls()
        of_beams = read_parameters(SonarToCloudParameters, rospy.resolve_name("sonar_to_cloud"))
        BeamSubscriber(core.hear, of_beams, core.health)
        subscribe_to_clouds(topics.CLEANED, core.insert, core.health)
        subscribe_to_clouds(topics.ECHOES, core.match, core.health)
        return core

    def insert(self, cloud: Cloud) -> None:
        """Insert a cloud; one that cannot be placed in the map is counted and left out."""
        guarded(self.health, self._insert)(cloud)

    def hear(self, beam: Beam) -> None:
        """Learn a beam, which shows what the head does."""
        self._localiser.following.found.hear(beam)

    def match(self, cloud: Cloud) -> None:
        """Match a scan of echoes; one that cannot be matched is counted."""
        if self._live.current.match_input is MatchInput.ECHOES:
            guarded(self.health, self._match)(cloud)

    def _use_parameters(self, parameters: MlsmCoreParameters) -> None:
        self._localiser.use(parameters.localiser_settings())

    def _start_matching(self, message: Bool) -> None:
        if self._localiser.match(message.data):
            rospy.loginfo("%s: matching is %s", self.health.name, "on" if message.data else "off")

    def _insert(self, cloud: Cloud) -> None:
        parameters = self._live.current
        self.health.count("clouds in")
        self.health.count("points in", len(cloud))
        self._check_header(cloud)
        report_broken(cloud, self.health)
        if parameters.match_input is MatchInput.CLEANED and cloud.frame_id != parameters.map_frame:
            guarded(self.health, self._match)(cloud)
        if parameters.map_input is MapInput.CLEANED:
            with self.health.timed():
                self._report_cloud(self._inserted(cloud), cloud.stamp_ns)

    def _inserted(self, cloud: Cloud) -> CloudUpdate:
        if cloud.frame_id == self._live.current.map_frame:
            return self._localiser.take_points(cloud.points[cloud.valid])
        self._notice_time_of_scan(cloud.stamp_ns * 1e-9)
        return self._localiser.take_cloud(MapCloud.from_stamps(cloud.points, cloud.time_stamps, cloud.stamp_ns * 1e-9))

    def _match(self, cloud: Cloud) -> None:
        self.health.count("scans in")
        self._check_header(cloud)
        self._notice_time_of_scan(cloud.stamp_ns * 1e-9)
        self._localiser.check_time(cloud.stamp_ns * 1e-9)
        scan = self._scan(self._without_far_points(cloud))
        if scan is None:
            return
        self._mount(cloud.stamp_ns)
        self._look_for_z_down(scan)
        self.status.hear(np.hypot(*(scan.points[:, :2] - scan.reference_pose[:2]).T))
        taken = self._localiser.take_scan(scan)
        for update in taken.clouds:
            self._report_cloud(update, cloud.stamp_ns)
        report_scan(self.health, taken.scan, self._localiser.estimator.matching)
        if taken.scan.found:
            rospy.loginfo("%s: found again after a silence of the sonar: %s", self.health.name, taken.scan.found)
        if taken.scan.loop:
            rospy.loginfo("%s: %s", self.health.name, taken.scan.loop)
        report_turn(self.health, scan.reference_time - scan.start, self._longest_turn)
        report_steps(self.health, self._localiser.following.odometry.steps, self._steps_told)
        self._steps_told = len(self._localiser.following.odometry.steps)
        self.status.verdicts, self.status.is_provisional = self._localiser.verdicts(), taken.scan.provisional
        report_verdicts(self.health, self.status.verdicts)
        self.health.show("odometry", self._localiser.odometry or self._live.current.odometry.value)
        self.status.tell()
        self._publish_fix(taken.scan, cloud.stamp_ns)

    def _look_for_z_down(self, scan: Scan) -> None:
        self._z_down.take_heights(self._odometry.matrix(scan.reference_time)[2:3, 3])
        self._z_down.take_scan(scan)
        signs = self._z_down.lines()
        if signs:
            self.health.problem("scans with signs of z down", f"{'; '.join(signs)}: {_Z_DOWN_ADVICE}")

    def _mount(self, stamp_ns: int) -> None:
        """Tell the localiser where the sonar is on the vehicle, once tf knows it."""
        if self._mounted:
            return
        place = self._odometry.place_on_vehicle(self._live.current.sonar_frame, stamp_ns * 1e-9)
        if place is not None:
            self._localiser.mount(place)
            self._mounted = True

    def _check_header(self, cloud: Cloud) -> None:
        self._odometry.tf.check_stamp(cloud.stamp_ns)
        allowed = self._live.current.odom_frame, self._live.current.map_frame
        if cloud.frame_id not in allowed:
            must = f"frame {cloud.frame_id!r}, must be {allowed[0]!r} or {allowed[1]!r}"
            raise RefusedInput("clouds refused", f"{must}; set sonar_to_cloud's target_frame")

    def _without_far_points(self, cloud: Cloud) -> Cloud:
        limit = self._live.current.map_limit
        far = cloud.beyond(limit)
        count = int(np.count_nonzero(far))
        if not count:
            return cloud
        detail = f"{count} of {len(cloud)} in a scan are beyond map_limit of {limit:g} m; check tf and the publisher"
        self.health.problem("echoes outside the map", detail, count)
        return cloud.select(~far)

    def _scan(self, cloud: Cloud) -> Optional[Scan]:
        time, times = cloud.stamp_ns * 1e-9, np.unique(np.abs(cloud.time_stamps[cloud.valid]))
        known = self._localiser.believed_until
        start = min([time, *times[:1], *([] if known is None else [known])])
        try:
            track = self._odometry.track(start, times, time, self._localiser.estimator.lookahead)
        except RefusedInput:
            self.health.count("scans not used")
            if self._localiser.estimator.matching:
                raise
            return None
        scan = Scan.from_stamps(cloud.points, cloud.time_stamps, time, self._localiser.following.bridged(track))
        known = scan.with_odometry()
        # A node that was started within a scan has no odometry of its beginning: it has no reason to warn.
        self.health.count("echoes without odometry", len(scan) - len(known))
        return known

    def _report_cloud(self, update: CloudUpdate, stamp_ns: int) -> None:
        self._map.change(stamp_ns)
        report_cloud(self.health, update, self._localiser.block_count, self._live.current.map_limit)

    def _publish_fix(self, update: ScanUpdate, stamp_ns: int) -> None:
        if update.result is None:
            return
        self._fix.show(update.scan, update.result, stamp_ns)
        if update.accepted:
            T_odom_base = self._odometry.matrix(update.scan.reference_time)
            T_map_base = matrices(update.scan.correction_to(update.result.pose)) @ T_odom_base
            self._fix.publish(update.result, T_map_base, stamp_ns)

    def _publish_found(self, update: ScanUpdate) -> None:
        self._publish_fix(update, round(update.scan.reference_time * 1e9))

    def _correction(self) -> np.ndarray:
        newest = self._odometry.newest()
        if newest is None:
            return self._localiser.last_correction
        time, pose = newest[0], planar(newest[1])
        if time is None:
            return self._localiser.following.standing_correction(pose)
        self._notice_time(time, pose)
        since = self._localiser.silent_since(time)
        if since is not None:
            self._localiser.follow(self._odometry.track(since, np.empty(0), time), time)
        return self._localiser.following.correction(time, pose)

    def _expect(self, message: PoseWithCovarianceStamped) -> None:
        """Take where somebody sees the vehicle in the map as where it is."""
        frame, newest = message.header.frame_id, self._odometry.newest()
        if frame != self._live.current.map_frame:
            raise RefusedInput("poses refused", f"frame {frame!r}, must be {self._live.current.map_frame!r}")
        if newest is None:
            raise RefusedInput("poses refused", "no odometry yet that would tell how the vehicle goes on from there")
        pose, covariance = planar_pose(message.pose)
        limit = self._live.current.map_limit
        if np.abs(pose[:2]).max() > limit:
            raise RefusedInput("poses refused", f"{pose[:2]} m is beyond map_limit of {limit:g} m")
        self._localiser.expect(pose, covariance, planar(newest[1]))
        rospy.loginfo("%s: the vehicle is expected at x %.1f m, y %.1f m", self.health.name, *pose[:2])

    def _notice_time_of_scan(self, time: float) -> None:
        """Notice that time jumped back; while the odometry goes on, an old scan is merely late.

        Where odometry never changes, and so has no time, the vehicle is still there.
        """
        newest_time, T_odom_base = self._odometry.newest() or (-np.inf, None)
        if newest_time is None or newest_time >= time:
            self._notice_time(time if newest_time is None else newest_time, planar(T_odom_base))
        else:
            self._notice_time(time)

    def _notice_time(self, time: float, odometry: Optional[np.ndarray] = None) -> None:
        seconds = self._localiser.notice_time(time, odometry)
        if seconds:
            self._odometry.tf.clear()
            self._z_down, self.status.verdicts = ZDownSigns(), ()
            place = "the position in it starts at odom's again"
            if self._localiser.is_lost:
                place = "the whole map is searched for the vehicle; call ~reset_map where another recording began"
            elif self._localiser.is_expected:
                place = "the vehicle is expected where it was"
            self.health.problem("jumps in time", f"by {-seconds:.1f} s; the map stays, {place}")

    def _after_replacing(self) -> None:
        self.status.verdicts = ()
        self._fix.clear()
        self._map.replace()


class Mapping:
    """Everything from beams to map in one process."""

    def __init__(self) -> None:
        """Raises ParameterError for a bad parameter of any stage."""
        self._core = MlsmCore(rospy.resolve_name("mlsm_core"))
        self._pipeline = Pipeline(CloudSink(self._core.insert), CloudSink(self._core.match), self._core.hear)
        self._core.status.stages_before = self._pipeline.healths
        self.healths: List[Health] = [*self._pipeline.healths, self._core.health]


def run_mlsm_core() -> None:
    run("mlsm_core", MlsmCore.as_node)


def run_mapping() -> None:
    run("mapping", Mapping, lambda mapping: mapping.healths)
