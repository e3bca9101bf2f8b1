"""The ROS side of sonar_to_cloud: beams, tf and the velocity in, scans out (thesis 4.5.1, 6.5.2)."""

from typing import Any, Callable, Dict, List, Optional, Tuple

import rospy
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2

from node_support import topics
from node_support.health import Health
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.beams.head import HeadWatch
from sonar_processing.cloud import NOBODY, Cloud, CloudSink
from sonar_processing.ros.beam_subscriber import BeamSubscriber
from sonar_processing.ros.cloud_topics import QUEUE_SIZE, CloudPublisher, PointsPublisher
from sonar_processing.ros.conversions import LaserScanArrays, laser_scan_message, point_cloud
from sonar_processing.ros.transform_filter import SonarMount, TransformFilter
from sonar_processing.scans.assembler import MovingState, RevolutionCollector, ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters, VelocityType
from sonar_processing.scans.polar_scan import TURN_FIELDS, PolarScan, planar_laser_scan, turn_cloud

_VELOCITY_KINDS: Dict[VelocityType, Tuple[type, Callable[[Any], Twist]]] = {
    VelocityType.TWIST: (Twist, lambda message: message),
    VelocityType.TWIST_STAMPED: (TwistStamped, lambda message: message.twist),
    VelocityType.ODOMETRY: (Odometry, lambda message: message.twist.twist),
}


class RevolutionPublisher:
    """The revolution as organised cloud, as LaserScan and as cloud with times; `sink` gets the organised cloud."""

    def __init__(self, health: Health, sink: CloudSink) -> None:
        self._health = health
        self._sink = sink
        self._clouds = CloudPublisher(topics.POLAR_SCANS)
        self._turns = rospy.Publisher(topics.TURNS, PointCloud2, queue_size=QUEUE_SIZE)
        self._lasers = rospy.Publisher(topics.LASER_SCANS, LaserScanArrays, queue_size=QUEUE_SIZE)

    def publish(self, beams: List[PlacedBeam], parameters: SonarToCloudParameters) -> None:
        self._health.count("turns")
        scan = PolarScan.of(beams)
        if self._lasers.get_num_connections():
            laser = planar_laser_scan(scan, parameters)
            self._lasers.publish(laser_scan_message(laser, scan.stamp_ns, scan.sonar_frame))
        if self._turns.get_num_connections():
            points = turn_cloud(scan, parameters)
            self._turns.publish(point_cloud(points, scan.stamp_ns, scan.sonar_frame, fields=TURN_FIELDS))
        is_taken = self._sink.is_wanted()
        if is_taken or self._clouds.is_read:
            cloud = scan.cloud(parameters)
            self._clouds.publish(cloud)
            if is_taken:
                self._sink.take(cloud)


class SonarToCloud:
    """Subscribes to beams, publishes scans and hands them on where stages share the process."""

    def __init__(
        self, namespace: str = "~", scan_sink: CloudSink = NOBODY, polar_sink: CloudSink = NOBODY,
        beam_sink: Callable[[Beam], None] = lambda _: None,
    ) -> None:  # fmt: skip
        """`scan_sink` takes scans, `polar_sink` organised clouds of whole revolutions, `beam_sink` each beam.

        Raises ParameterError for a bad parameter in `namespace`.
        """
        self.health = make_health("sonar_to_cloud")
        self._scan_sink, self._beam_sink = scan_sink, beam_sink
        self._moving_state = MovingState()
        self._revolution = RevolutionCollector()
        self._head = HeadWatch()
        self._turned: Optional[float] = None
        self._live = ReconfigurableParameters(SonarToCloudParameters, namespace, self.health, self._use_parameters)
        self._scans = CloudPublisher(topics.SCANS)
        self._laser_scans = PointsPublisher(topics.LASER_POINTS)
        self._newest_beam = PointsPublisher(topics.NEWEST_BEAM)
        self._revolutions = RevolutionPublisher(self.health, polar_sink)
        parameters = self._live.current
        mount = SonarMount(parameters, self.health.name)
        self._filter = TransformFilter(
            parameters.target_frame, self.health, self._place, self._forget_scan, parameters.stamp_tolerance, mount
        )
        kind, self._twist_of = _VELOCITY_KINDS[parameters.velocity_type]
        take = guarded(self.health, self._take_velocity)
        rospy.Subscriber(parameters.velocity_topic, kind, take, queue_size=QUEUE_SIZE)
        self.health.expect(rospy.resolve_name(topics.BEAMS))
        BeamSubscriber(self._take_beam, parameters, self.health, self._filter.forget, self._filter.make_room)

    def _use_parameters(self, parameters: SonarToCloudParameters) -> None:
        self._assembler = ScanAssembler(parameters)
        if self._turned not in (None, parameters.sonar_turned):
            self._revolution.clear()
            rospy.logwarn(
                "%s: sonar_turned is %.3f rad now: the map holds scans that were placed otherwise; call reset_map of "
                "mlsm_core to begin it anew", self.health.name, parameters.sonar_turned,
            )  # fmt: skip
        self._turned = parameters.sonar_turned

    def _forget_scan(self) -> None:
        self._assembler.clear()
        self._revolution.clear()

    def _take_velocity(self, message: Any) -> None:
        self.health.count("velocities in")
        twist = self._twist_of(message)
        self._moving_state.take(_components(twist.linear), _components(twist.angular))

    def _take_beam(self, beam: Beam) -> None:
        self.health.count("points in", beam.intensities.size)
        for event, number in self._head.add(beam).items():
            self.health.count(event.value, number)
        self._filter.add(self._live.current.corrected(beam), self._is_moving(beam.stamp_ns))

    def _is_moving(self, stamp_ns: int) -> bool:
        parameters = self._live.current
        if not self._moving_state.was_heard:
            self.health.show("velocity", f"nothing received on {parameters.velocity_topic}: all beams count as still")
            return False
        moving, age = self._moving_state.is_moving(parameters), self._moving_state.age(stamp_ns)
        self.health.show("velocity", "moving" if moving else "still")
        if moving and age > parameters.velocity_timeout:
            self.health.problem("beams of an old velocity", f"{parameters.velocity_topic} is silent for {age:.1f} s")
        return moving

    def _place(self, placed: PlacedBeam) -> None:
        parameters = self._live.current
        with self.health.timed():
            if parameters.sonar_turned:
                placed = placed.turned(parameters.sonar_turned)
            if self._newest_beam.is_read:
                self._newest_beam.publish(self._assembler.project(placed))
            scan = self._assembler.add(placed)
            revolution = self._revolution.add(placed)
        self.health.count("beams placed")
        self._beam_sink(placed.beam)
        if scan is not None:
            self._publish(scan)
        if revolution is not None:
            self._revolutions.publish(revolution, parameters)

    def _publish(self, scan: Cloud) -> None:
        self.health.count("scans")
        self.health.count("points out", len(scan))
        self._scans.publish(scan)
        if self._live.current.mode.is_laser:
            self._laser_scans.publish(scan)
        self._scan_sink.take(scan)


def _components(vector: Vector3) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z
