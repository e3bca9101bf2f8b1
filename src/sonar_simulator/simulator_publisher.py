"""Publishes what happens at one moment of a simulation."""

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Pose, TransformStamped, Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32

from sonar_processing.transforms import pose_from_matrix
from sonar_simulator.simulation import Moment, Ping
from underwater_map_construction.msg import SonarScanLine

SONAR_FRAME = "sonar"
BASE_FRAME = "base_link"
ODOM_FRAME = "odom"
WORLD_FRAME = "map"
_QUEUE_SIZE = 50


class SimulatorPublisher:
    """Topics of the simulator. With no matching needed, its world is the frame `map`."""

    def __init__(self, max_range: float, range_resolution: float) -> None:
        self._max_range = max_range
        self._range_resolution = range_resolution
        self._clock = rospy.Publisher("/clock", Clock, queue_size=_QUEUE_SIZE)
        self._odometry = rospy.Publisher("odom", Odometry, queue_size=_QUEUE_SIZE)
        self._truth = rospy.Publisher("ground_truth", Odometry, queue_size=_QUEUE_SIZE)
        self._velocity = rospy.Publisher("cmd_vel", Twist, queue_size=_QUEUE_SIZE)
        self._beams = rospy.Publisher("sonar/raw", SonarScanLine, queue_size=_QUEUE_SIZE, tcp_nodelay=True)
        self._progress = rospy.Publisher("~progress", Float32, queue_size=1, latch=True)
        self._transforms = tf2_ros.TransformBroadcaster()

    @property
    def has_listener(self) -> bool:
        """Whether anybody takes the beams."""
        return self._beams.get_num_connections() > 0

    def publish_clock(self, stamp: rospy.Time) -> None:
        """Set everybody's time."""
        self._clock.publish(Clock(clock=stamp))

    def publish_progress(self, share: float) -> None:
        """Tell which share of the script is done; 1 at its end."""
        self._progress.publish(Float32(data=share))

    def publish(self, moment: Moment, stamp: rospy.Time) -> None:
        """Send everything that belongs to a moment."""
        self.publish_clock(stamp)
        odom_pose = pose_from_matrix(moment.T_odom_base)
        self._transforms.sendTransform(_transform(odom_pose, stamp))
        twist = _twist(moment.twist)
        self._velocity.publish(twist)
        self._odometry.publish(_odometry(odom_pose, twist, stamp, ODOM_FRAME))
        truth_pose = pose_from_matrix(moment.T_world_base)
        self._truth.publish(_odometry(truth_pose, Twist(), stamp, WORLD_FRAME))
        if moment.ping is not None:
            self._beams.publish(self._beam(moment.ping, stamp))

    def _beam(self, ping: Ping, stamp: rospy.Time) -> SonarScanLine:
        message = SonarScanLine()
        message.header.stamp = stamp
        message.header.frame_id = SONAR_FRAME
        message.angle = ping.angle
        message.intensities = ping.strengths.tobytes()
        message.maxrange_meters = self._max_range
        message.range_resolution = self._range_resolution
        return message


def _transform(pose: Pose, stamp: rospy.Time) -> TransformStamped:
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = ODOM_FRAME
    message.child_frame_id = BASE_FRAME
    message.transform.translation = pose.position
    message.transform.rotation = pose.orientation
    return message


def _twist(values: np.ndarray) -> Twist:
    message = Twist()
    message.linear.x, message.linear.y, message.linear.z = values[:3]
    message.angular.x, message.angular.y, message.angular.z = values[3:]
    return message


def _odometry(pose: Pose, twist: Twist, stamp: rospy.Time, frame: str) -> Odometry:
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.child_frame_id = BASE_FRAME
    message.pose.pose = pose
    message.twist.twist = twist
    return message
