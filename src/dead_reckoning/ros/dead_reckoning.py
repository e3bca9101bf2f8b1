"""The ROS side of dead_reckoning: heading, depth and velocity in; odom -> base_link and odometry out."""

import threading
from typing import Any, Callable, Dict, Optional, Sequence, Tuple

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseWithCovarianceStamped, Transform, TransformStamped, Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import FluidPressure, Imu
from std_msgs.msg import Float64

from dead_reckoning.dead_reckoner import (
    GAPS,
    DeadReckoner,
    DeadReckoningParameters,
    DepthType,
    HeadingType,
    Reckoning,
    VelocitySource,
    depth_of_pressure,
    rotation_of_heading,
)
from dead_reckoning.velocity_messages import velocity_type
from node_support import topics
from node_support.errors import RefusedInput
from node_support.headers import check_frame
from node_support.ros.callbacks import MessageClasses, guarded, make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import TfBuffer, header, pose_from_matrix, rotation_from_message

QUEUE_SIZE = 100  # a second of a fast AHRS
_REFUSED_HEADINGS = "headings refused"
_MISALIGNED = "instruments without a mount"
_NO_ORIENTATION = -1.0  # sensor_msgs/Imu: in the first covariance of a device that measures no orientation


class DeadReckoning:
    """Publishes at the rate of the headings."""

    def __init__(self) -> None:
        """Raises ParameterError for a bad parameter."""
        self.health = make_health("dead_reckoning")
        self._lock = threading.Lock()
        self._classes = MessageClasses()
        self._live = ReconfigurableParameters(DeadReckoningParameters, "~", self.health, self._use_parameters)
        self._transforms = TfBuffer(self.health, tolerance=self._live.current.stamp_tolerance)
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._odometry = rospy.Publisher(topics.ODOMETRY, Odometry, queue_size=QUEUE_SIZE)
        self._subscribe()

    def _use_parameters(self, parameters: DeadReckoningParameters) -> None:
        if hasattr(self, "_reckoner"):
            self._reckoner.parameters = parameters
        else:
            self._reckoner = DeadReckoner(parameters)

    def _subscribe(self) -> None:
        parameters = self._live.current
        velocities: Dict[VelocitySource, Tuple[str, type, Callable[[Any], None]]] = {
            VelocitySource.ESTIMATE: (topics.MATCHED_ODOMETRY, Odometry, self._take_estimate),
            VelocitySource.COMMANDS: (topics.VELOCITY_COMMANDS, Twist, self._take_command),
            VelocitySource.MEASURED: (topics.MEASURED_VELOCITY, rospy.AnyMsg, self._take_measured),
        }
        depths: Dict[DepthType, Tuple[type, Callable[[Any], float]]] = {
            DepthType.POSE: (PoseWithCovarianceStamped, lambda message: -message.pose.pose.position.z),
            DepthType.DEPTH: (Float64, lambda message: message.data),
            DepthType.ALTITUDE: (Float64, lambda message: -message.data),
            DepthType.PRESSURE: (FluidPressure, self._depth_of_pressure),
        }
        heading = (Imu, self._take_imu) if parameters.heading_type is HeadingType.IMU else (Float64, self._take_compass)
        inputs = [velocities[parameters.velocity_source], (topics.HEADING, *heading)]
        if parameters.depth_type in depths:
            kind, depth_of = depths[parameters.depth_type]
            inputs.append((topics.DEPTH, kind, lambda message: self._take_depth(depth_of(message))))
        self.health.expect(rospy.resolve_name(topics.HEADING))
        for topic, kind, take in inputs:
            # Commands of thrusters come only while somebody drives; all else must not cease.
            call = guarded(self.health, take, "" if topic == topics.VELOCITY_COMMANDS else topic)
            rospy.Subscriber(topic, kind, call, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _depth_of_pressure(self, message: FluidPressure) -> float:
        parameters = self._live.current
        return depth_of_pressure(message.fluid_pressure, parameters.surface_pressure, parameters.water_density)

    def _take_depth(self, depth: float) -> None:
        self.health.count("depths in")
        with self._lock:
            self._reckoner.take_depth(depth)

    def _take_estimate(self, message: Odometry) -> None:
        stamp_ns = message.header.stamp.to_nsec()
        self._transforms.check_stamp(stamp_ns)
        self._take_velocity(stamp_ns, message.twist.twist)

    def _take_command(self, message: Twist) -> None:
        self._take_velocity(rospy.get_rostime().to_nsec(), message)

    def _take_measured(self, message: rospy.AnyMsg) -> None:
        self.health.count("velocities in")
        kind = velocity_type(message._connection_header["type"])
        fields = kind.fields(self._classes.deserialised(message))
        stamp_ns = fields.stamp_ns or rospy.get_rostime().to_nsec()
        self._transforms.check_stamp(stamp_ns)
        self._reckon(stamp_ns, *kind.in_vehicle(fields, self._mount(fields.frame_id, stamp_ns)))

    def _take_velocity(self, stamp_ns: int, twist: Twist) -> None:
        self.health.count("velocities in")
        self._reckon(stamp_ns, np.array([twist.linear.x, twist.linear.y, twist.linear.z]))

    def _reckon(self, stamp_ns: int, velocity: np.ndarray, instrument: Sequence[float] = (0.0, 0.0)) -> None:
        with self._lock:
            self._reckoner.take_velocity(stamp_ns, velocity, instrument)

    def _take_imu(self, message: Imu) -> None:
        self.health.count("headings in")
        stamp_ns = message.header.stamp.to_nsec()
        self._transforms.check_stamp(stamp_ns)
        self._take_orientation(stamp_ns, self._orientation_of_vehicle(message))

    def _take_compass(self, message: Float64) -> None:
        self.health.count("headings in")
        rotation = rotation_of_heading(message.data, self._live.current.heading_type)
        self._take_orientation(rospy.get_rostime().to_nsec(), rotation)

    def _take_orientation(self, stamp_ns: int, rotation: np.ndarray) -> None:
        with self._lock:
            reckoning = self._reckoner.take_orientation(stamp_ns, rotation)
        if reckoning.gap:
            self.health.problem(GAPS, f"{reckoning.gap:.1f} s before {stamp_ns * 1e-9:.3f} s; check the compass")
        self._publish(reckoning)

    def _orientation_of_vehicle(self, message: Imu) -> np.ndarray:
        """Return R_odom_base (3, 3); raises RefusedInput for a message without an orientation."""
        if message.orientation_covariance[0] == _NO_ORIENTATION:
            raise RefusedInput(_REFUSED_HEADINGS, "the Imu says that it measures no orientation; choose another topic")
        R_odom_imu = rotation_from_message(message.orientation, _REFUSED_HEADINGS)
        mount = self._mount(message.header.frame_id, message.header.stamp.to_nsec())
        return R_odom_imu if mount is None else R_odom_imu @ mount[:3, :3].T

    def _mount(self, frame: str, stamp_ns: int) -> Optional[np.ndarray]:
        """Return T_base_instrument (4, 4); None for the vehicle's own frame, and where tf does not know it.

        Such an instrument is taken as aligned with the vehicle.
        """
        base_frame = self._live.current.base_frame
        if frame == base_frame:
            return None
        try:
            check_frame(frame, _MISALIGNED)
            return self._transforms.matrix(base_frame, frame, stamp_ns)
        except RefusedInput:
            self.health.problem(_MISALIGNED, f"tf does not know {frame!r} in {base_frame}: taken as aligned with it")
            return None

    def _publish(self, reckoning: Reckoning) -> None:
        parameters = self._live.current
        stamped = header(reckoning.stamp_ns, parameters.odom_frame)
        pose = pose_from_matrix(reckoning.T_odom_base)
        transform = Transform(pose.position, pose.orientation)
        self._broadcaster.sendTransform(TransformStamped(stamped, parameters.base_frame, transform))
        odometry = Odometry(header=stamped, child_frame_id=parameters.base_frame)
        odometry.pose.pose = pose
        odometry.twist.twist = Twist(Vector3(*reckoning.velocity), Vector3(0.0, 0.0, reckoning.turn_rate))
        self._odometry.publish(odometry)
        self.health.count("transforms sent")
