"""The ROS side of autopilot_link: tf, fixes and their status in; positions out."""

import threading
from typing import TYPE_CHECKING, Optional, Tuple, Union

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, Transform

from autopilot_link.parameters import AutopilotLinkParameters
from autopilot_link.protocol import Corrections, StatedPose, enu_of_map, full_covariance, velocity_between
from autopilot_link.ros.instruments import Instruments
from autopilot_link.ros.mavros_topics import MavrosTopics
from node_support import topics
from node_support.health import SILENCE
from node_support.ros.callbacks import every, guarded, make_health
from node_support.ros.node import DIAGNOSTICS_PERIOD, StartError
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import JUMP_BACK, TfBuffer, matrix_from_message
from sonar_driver.line.port import PortRefusedError
from underwater_map_construction.msg import PositionStatus

if TYPE_CHECKING:
    from autopilot_link.link import AutopilotLink


class AutopilotLinkNode:
    """Sends the position at the newest odometry, as often as `rate` says, while it is good."""

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace`, StartError for a connection that is none."""
        self.health = make_health("autopilot_link")
        self.healths = [self.health]
        self._lock = threading.Lock()
        self._corrections = Corrections()
        self._status: Optional[Tuple[float, PositionStatus]] = None
        self._due_ns, self._last = 0, (0, np.eye(4))
        self._live = ReconfigurableParameters(AutopilotLinkParameters, namespace, self.health, lambda _: None)
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

            return AutopilotLink(parameters, self.health, _now_ns, take)
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


def _now_ns() -> int:
    return rospy.get_rostime().to_nsec()
