"""The ROS side of autopilot_link: tf, fixes and their status in; positions, and what the autopilot measures, out."""

import threading
from typing import TYPE_CHECKING, Any, Optional, Tuple, Union

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion, Transform, Twist, TwistStamped, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import FluidPressure, Imu
from std_msgs.msg import Header

from autopilot_link.parameters import AutopilotLinkParameters, PoseMessage
from autopilot_link.protocol import (
    Corrections,
    StatedPose,
    enu_of_map,
    full_covariance,
    rotation_of_attitude,
    velocity_between,
    velocity_of_ned,
)
from node_support import topics
from node_support.errors import RefusedInput
from node_support.geometry import quaternion_of
from node_support.headers import JUMP_BACK, check_stamp
from node_support.health import SILENCE
from node_support.ros.callbacks import every, guarded, make_health
from node_support.ros.node import DIAGNOSTICS_PERIOD, StartError
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import TfBuffer, header, matrix_from_message, pose_from_matrix
from sonar_driver.port import PortRefusedError
from underwater_map_construction.msg import PositionStatus


class MavrosTopics:
    """Stands where an AutopilotLink would; MAVROS takes no reset counter."""

    name = "MAVROS"

    def __init__(self, parameters: AutopilotLinkParameters) -> None:
        self._frames = parameters.map_frame, parameters.base_frame
        if parameters.message is PoseMessage.ODOMETRY:
            self._publisher = rospy.Publisher(topics.MAVROS_ODOMETRY, Odometry, queue_size=10)
        else:
            self._publisher = rospy.Publisher(topics.MAVROS_POSE, PoseWithCovarianceStamped, queue_size=10)

    def obstacle(self) -> str:
        """Return why no position can be sent now; empty when one can."""
        return "" if self._publisher.get_num_connections() else f"nobody listens to {self._publisher.resolved_name}"

    def send(self, pose: StatedPose) -> None:
        message = self._publisher.data_class()
        message.header = header(pose.stamp_ns, self._frames[0])
        message.pose.pose = pose_from_matrix(pose.T_enu_base)
        message.pose.covariance = pose.covariance.ravel().tolist()
        if isinstance(message, Odometry):
            message.child_frame_id = self._frames[1]
            message.twist.twist = Twist(Vector3(*pose.velocity), Vector3(np.nan, np.nan, np.nan))
            message.twist.covariance[0] = np.nan
        self._publisher.publish(message)


if TYPE_CHECKING:
    from autopilot_link.link import AutopilotLink


_PASCAL = 100.0  # in a hectopascal


class Instruments:
    """Heading from ATTITUDE, pressure from SCALED_PRESSURE2, velocity from LOCAL_POSITION_NED."""

    def __init__(self, base_frame: str) -> None:
        self._base_frame = base_frame
        self._orientation: Optional[np.ndarray] = None
        self._headings = rospy.Publisher(topics.HEADING, Imu, queue_size=10, tcp_nodelay=True)
        self._depths = rospy.Publisher(topics.DEPTH, FluidPressure, queue_size=10)
        self._velocities = rospy.Publisher(topics.MEASURED_VELOCITY, TwistStamped, queue_size=10)

    def take(self, message: Any, offset_ns: Optional[int]) -> None:
        """Take a message of the autopilot, whose clock is `offset_ns` ahead of ours, None where nobody knows.

        Raises RefusedInput for one that is broken.
        """
        takers = {
            "ATTITUDE": self._take_attitude,
            "SCALED_PRESSURE2": self._take_pressure,
            "LOCAL_POSITION_NED": self._take_velocity,
        }
        take = takers.get(message.get_type())
        if take is not None:
            take(message, self._header(message.time_boot_ms, offset_ns))

    def _header(self, boot_ms: int, offset_ns: Optional[int]) -> Header:
        stamp_ns = rospy.get_rostime().to_nsec() if offset_ns is None else boot_ms * 10**6 - offset_ns
        check_stamp(stamp_ns)
        return header(stamp_ns, self._base_frame)

    def _take_attitude(self, attitude: Any, stamped: Header) -> None:
        self._orientation = rotation_of_attitude(attitude.roll, attitude.pitch, attitude.yaw)
        imu = Imu(header=stamped, orientation=Quaternion(*quaternion_of(self._orientation)))
        # Rates are the vehicle's own, ahead, right, down.
        imu.angular_velocity = Vector3(attitude.rollspeed, -attitude.pitchspeed, -attitude.yawspeed)
        imu.linear_acceleration_covariance[0] = -1.0  # not measured (sensor_msgs/Imu)
        self._headings.publish(imu)

    def _take_pressure(self, pressure: Any, stamped: Header) -> None:
        self._depths.publish(FluidPressure(header=stamped, fluid_pressure=pressure.press_abs * _PASCAL))

    def _take_velocity(self, local: Any, stamped: Header) -> None:
        if self._orientation is None:
            raise RefusedInput("velocities refused", "LOCAL_POSITION_NED came before any ATTITUDE")
        velocity = velocity_of_ned((local.vx, local.vy, local.vz), self._orientation)
        self._velocities.publish(TwistStamped(stamped, Twist(Vector3(*velocity), Vector3())))


class AutopilotLinkNode:
    """Sends the position at the newest odometry, as often as `rate` says, while it is good."""

    def __init__(self) -> None:
        """Raises ParameterError for a bad parameter, StartError for a connection that is none."""
        self.health = make_health("autopilot_link")
        self._lock = threading.Lock()
        self._corrections = Corrections()
        self._status: Optional[Tuple[float, PositionStatus]] = None
        self._due_ns, self._last = 0, (0, np.eye(4))
        self._live = ReconfigurableParameters(AutopilotLinkParameters, "~", self.health, lambda _: None)
        parameters = self._live.current
        self._output = self._opened(parameters)
        self._transforms = TfBuffer(
            self.health, tolerance=parameters.stamp_tolerance, on_news=guarded(self.health, self._look)
        )
        for topic, kind, take in (
            (topics.POSITION_STATUS, PositionStatus, self._take_status),
            (topics.MATCHED_POSE, PoseWithCovarianceStamped, self._take_fix),
        ):
            rospy.Subscriber(topic, kind, guarded(self.health, take), queue_size=10, tcp_nodelay=True)
        every(DIAGNOSTICS_PERIOD, self._tell, self.health)

    def _opened(self, parameters: AutopilotLinkParameters) -> Union[MavrosTopics, "AutopilotLink"]:
        if not parameters.connection:
            return MavrosTopics(parameters)
        take = guarded(self.health, Instruments(parameters.base_frame).take)
        try:
            # Where MAVROS runs, pymavlink may be missing.
            from autopilot_link.link import AutopilotLink

            return AutopilotLink(parameters, self.health, lambda: rospy.get_rostime().to_nsec(), take)
        except (ImportError, PortRefusedError) as error:
            raise StartError(str(error)) from error

    def _take_status(self, status: PositionStatus) -> None:
        self._status = rospy.get_time(), status

    def _take_fix(self, fix: PoseWithCovarianceStamped) -> None:
        self.health.count("fixes in")
        stamp_ns = fix.header.stamp.to_nsec()
        self._transforms.check_stamp(stamp_ns)
        frames = self._live.current
        T_map_base = matrix_from_message(Transform(fix.pose.pose.position, fix.pose.pose.orientation))
        T_odom_base = self._transforms.matrix(frames.odom_frame, frames.base_frame, stamp_ns)
        newest = self._transforms.newest(frames.odom_frame, frames.base_frame)
        with self._lock:
            self._corrections.take_fix(newest[0], T_map_base @ np.linalg.inv(T_odom_base))
            # The next odometry carries it to the autopilot.
            self._due_ns = 0

    def _look(self) -> None:
        """Send the position at the newest odometry, where that is due."""
        frames = self._live.current
        newest = self._transforms.newest(frames.map_frame, frames.base_frame)
        if newest is None or not newest[0]:
            return
        with self._lock:
            if not self._is_due(newest[0]):
                return
            obstacle = self._obstacle()
            if obstacle:
                self.health.problem("positions withheld", obstacle)
                return
            self._send(*newest)

    def _is_due(self, stamp_ns: int) -> bool:
        """Return whether a message at a stamp is due, and set the time of the next one."""
        period_ns = round(1e9 / self._live.current.rate)
        if stamp_ns < self._last[0] - JUMP_BACK * 1e9:
            self._due_ns, self._last = 0, (0, np.eye(4))
        late_ns = stamp_ns - self._due_ns
        if stamp_ns <= self._last[0] or late_ns < 0:
            return False
        self._due_ns = period_ns + (self._due_ns if late_ns < period_ns else stamp_ns)
        return True

    def _obstacle(self) -> str:
        if self._status is None:
            return f"{rospy.resolve_name(topics.POSITION_STATUS)} tells nothing yet"
        heard, status = self._status
        age = rospy.get_time() - heard
        if not -SILENCE < age < SILENCE:
            return f"{rospy.resolve_name(topics.POSITION_STATUS)} tells nothing for {age:.0f} s"
        return self._output.obstacle() if status.state == PositionStatus.GOOD else status.text

    def _send(self, stamp_ns: int, T_map_base: np.ndarray) -> None:
        parameters, (last_ns, T_last) = self._live.current, self._last
        T_odom_base = self._transforms.matrix(parameters.odom_frame, parameters.base_frame, stamp_ns)
        T_map_odom = T_map_base @ np.linalg.inv(T_odom_base)
        T_map_base = self._corrections.corrected(stamp_ns, T_map_odom, T_odom_base, parameters)
        velocity = velocity_between(T_last, T_odom_base, (stamp_ns - last_ns) * 1e-9)
        covariance = full_covariance(np.reshape(self._status[1].covariance, (3, 3)), parameters)
        pose = enu_of_map(parameters.map_azimuth_deg) @ T_map_base
        self._last = stamp_ns, T_odom_base
        self._output.send(StatedPose(stamp_ns, pose, velocity, covariance, self._corrections.jumps % 256))
        self.health.count("positions sent")

    def _tell(self) -> None:
        with self._lock:
            self.health.show("sent now", self._obstacle() or "yes")
        self.health.show("connection", self._output.name)
        self.health.total("jumps told by reset_counter", self._corrections.jumps)
