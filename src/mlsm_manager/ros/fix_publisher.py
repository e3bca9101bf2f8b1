"""Publishes where matching found the vehicle: fix, path, and the transform map -> odom."""

from typing import Callable, Tuple

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import PointCloud2

from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.scan_matching.scan import MatchResult, Scan, corrected_points
from mlsm_manager.scan_matching.scan_path import POSE
from node_support import topics
from node_support.errors import RefusedInput
from node_support.headers import check_stamp
from node_support.health import Health
from node_support.ros.callbacks import every_clock_period
from node_support.ros.transforms import pose_from_matrix, rotation_from_message
from sonar_processing.ros.conversions import header, point_cloud

UNKNOWN_VARIANCE = 1e6  # m^2 and rad^2: what a filter such as robot_localization takes for "not measured"
_ROS_AXES = np.array([0, 1, 5])  # x, y and yaw among the six axes of a covariance message
_LONGEST_PATH = 20000  # poses: four days of scans of 16 s, 1.5 MB


class FixPublisher:
    """Publishes /MLSM/pose, /MLSM/odometry, /MLSM/path and /MLSM/scan.

    z, roll and pitch of poses are those of tf and have no certainty.
    """

    def __init__(self, map_frame: str, base_frame: str) -> None:
        self._map_frame = map_frame
        self._base_frame = base_frame
        self._pose = rospy.Publisher(topics.MATCHED_POSE, PoseWithCovarianceStamped, queue_size=10)
        self._odometry = rospy.Publisher(topics.MATCHED_ODOMETRY, Odometry, queue_size=10)
        self._path = rospy.Publisher(topics.MATCHED_PATH, Path, queue_size=2, latch=True)
        self._scan = rospy.Publisher(topics.MATCHED_SCAN, PointCloud2, queue_size=2)
        self._matched_path = Path()

    def clear(self) -> None:
        self._matched_path = Path()

    def show(self, scan: Scan, result: MatchResult, stamp_ns: int) -> None:
        """Send a scan as a match undistorts and places it, accepted or not, to those who listen."""
        if self._scan.get_num_connections():
            self._scan.publish(point_cloud(corrected_points(scan, result), stamp_ns, self._map_frame))

    def publish(self, result: MatchResult, T_map_base: np.ndarray, stamp_ns: int) -> None:
        """Send the fix of a match; `T_map_base` is the matched pose with z, roll and pitch, (4, 4)."""
        fix = PoseWithCovarianceStamped(header=header(stamp_ns, self._map_frame))
        fix.pose.pose = pose_from_matrix(T_map_base)
        fix.pose.covariance = pose_covariance(result.covariance[POSE, POSE])
        self._pose.publish(fix)
        odometry = Odometry(header=fix.header, child_frame_id=self._base_frame, pose=fix.pose)
        twist = odometry.twist.twist
        twist.linear.x, twist.linear.y, twist.angular.z = result.velocity
        odometry.twist.covariance = pose_covariance(result.covariance[3:, 3:])
        self._odometry.publish(odometry)
        pose = PoseStamped(header=fix.header, pose=fix.pose.pose)
        self._matched_path.header = pose.header
        self._matched_path.poses = [*self._matched_path.poses[-_LONGEST_PATH:], pose]
        self._path.publish(self._matched_path)


def pose_covariance(planar: np.ndarray) -> list:
    """Return the 36 entries of a message whose x, y and yaw have the covariance `planar` (3, 3)."""
    full = np.diag(np.full(6, UNKNOWN_VARIANCE))
    full[np.ix_(_ROS_AXES, _ROS_AXES)] = planar
    return full.ravel().tolist()


def planar_pose(message: PoseWithCovariance) -> Tuple[np.ndarray, np.ndarray]:
    """Return x, y [m] and yaw [rad] (3,) of a message, and their covariance (3, 3); raises RefusedInput for none."""
    at, rotation = message.pose.position, rotation_from_message(message.pose.orientation, "poses refused")
    pose = np.array([at.x, at.y, np.arctan2(rotation[1, 0], rotation[0, 0])])
    covariance = np.reshape(message.covariance, (6, 6))[np.ix_(_ROS_AXES, _ROS_AXES)]
    if not np.isfinite(pose).all() or not np.isfinite(covariance).all() or np.linalg.eigvalsh(covariance)[0] <= 0.0:
        raise RefusedInput("poses refused", f"x, y, yaw {pose} with variances {np.diag(covariance)}, must be above 0")
    return pose, covariance


class MapTransform:
    """The correction that tf knows as map -> odom."""

    def __init__(
        self, parameters: Callable[[], MlsmCoreParameters], correction: Callable[[], np.ndarray], health: Health
    ) -> None:
        """`parameters` and `correction`, T_map_odom (3,), return what holds now."""
        self._parameters = parameters
        self._correction = correction
        self._health = health
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._last_stamp = rospy.Time(0)
        self.newest = np.zeros(3)
        """T_map_odom (3,) that was sent last."""
        every_clock_period(1.0 / parameters().transform_rate, self._send, health)

    def _send(self) -> None:
        parameters = self._parameters()
        stamp = rospy.Time.now() + rospy.Duration(parameters.transform_tolerance)
        if stamp == self._last_stamp:
            return
        check_stamp(stamp.to_nsec())
        self._last_stamp = stamp
        self.newest = self._correction()
        x, y, yaw = self.newest
        message = TransformStamped()
        message.header.stamp = stamp
        message.header.frame_id = parameters.map_frame
        message.child_frame_id = parameters.odom_frame
        message.transform.translation.x, message.transform.translation.y = x, y
        message.transform.rotation.z, message.transform.rotation.w = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
        self._broadcaster.sendTransform(message)
        self._health.count("transforms sent")
