"""Publishes what happens at one moment of a simulation."""

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32

from sonar_simulator.simulation import Moment
from sonar_simulator.simulator_messages import TOPICS, joint_state, moment_messages

_QUEUE_SIZE = 100


class SimulatorPublisher:
    """The simulator's topics. Its world is the frame `map`, which the odometry's error moves away from `odom`."""

    def __init__(self, max_range: float) -> None:
        self._max_range = max_range
        self._clock = rospy.Publisher("/clock", Clock, queue_size=_QUEUE_SIZE)
        self._progress = rospy.Publisher("~progress", Float32, queue_size=1, latch=True)
        self._publishers = {
            topic: rospy.Publisher(topic, kind, queue_size=_QUEUE_SIZE, tcp_nodelay=True)
            for topic, kind in TOPICS.items()
        }

    @property
    def has_listener(self) -> bool:
        """Whether anybody takes the beams."""
        return self._publishers["sonar/raw"].get_num_connections() > 0

    def publish_clock(self, stamp: rospy.Time) -> None:
        """Set everybody's time."""
        self._clock.publish(Clock(clock=stamp))

    def publish_rest(self, stamp: rospy.Time) -> None:
        """Send what a robot's description needs to stand still: the time, and the servo at 0."""
        self.publish_clock(stamp)
        self._publishers["joint_states"].publish(joint_state(0.0, stamp))

    def publish_progress(self, share: float) -> None:
        """Tell which share of the script is done; 1 at its end."""
        self._progress.publish(Float32(data=share))

    def publish(self, moment: Moment, stamp: rospy.Time) -> None:
        """Send everything that belongs to a moment."""
        self.publish_clock(stamp)
        for topic, message in moment_messages(moment, stamp, self._max_range):
            self._publishers[topic].publish(message)
