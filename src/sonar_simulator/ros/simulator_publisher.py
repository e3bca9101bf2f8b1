"""Publishes the state at one moment of a simulation."""

import numpy as np
import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32
from visualization_msgs.msg import Marker

from node_support import topics
from sonar_simulator.ros.simulator_messages import CLASSES, MESSAGES
from sonar_simulator.ros.world_marker import world_marker
from sonar_simulator.simulation.moment_messages import MAP_FRAME, TOPICS
from sonar_simulator.simulation.simulation import Drive, Instruments, Moment
from sonar_simulator.world.world import World

_QUEUE_SIZE = 100  # A second of every topic at the usual rates


class SimulatorPublisher:
    """The simulator's topics. Its world is in the frame `map`, from which `odom` drifts away by the odometry's error.

    If the vehicle follows a script, nobody sends commands; the velocity is then also published on cmd_vel, where other
    nodes expect it.
    """

    def __init__(self, max_range: float, drive: Drive, instruments: Instruments, origin: np.ndarray) -> None:
        """`max_range`: of the sonar, m. origin: (3,) m, where the map begins in the world."""
        self._origin = origin
        self._max_range = max_range
        self._instruments = instruments
        self._clock = rospy.Publisher(topics.CLOCK, Clock, queue_size=_QUEUE_SIZE)
        self._progress = rospy.Publisher("~progress", Float32, queue_size=1, latch=True)
        self._world = rospy.Publisher("~world", Marker, queue_size=1, latch=True)
        self._publishers = {topic: _publisher(topic, kind) for topic, kind in TOPICS[instruments].items()}
        velocity = TOPICS[instruments].get(topics.VELOCITY)
        is_told = drive is Drive.SCRIPT and velocity is not None
        self._commands = _publisher(topics.VELOCITY_COMMANDS, velocity) if is_told else None

    @property
    def has_listener(self) -> bool:
        """Whether anybody subscribes to the beams."""
        return self._publishers[topics.BEAMS].get_num_connections() > 0

    def publish_clock(self, stamp: rospy.Time) -> None:
        """Publish the simulated time."""
        self._clock.publish(Clock(clock=stamp))

    def publish_rest(self, moment: Moment, stamp: rospy.Time) -> None:
        """Publish what places a waiting sonar: the time, and the vehicle and its servo at a moment."""
        self.publish_clock(stamp)
        for topic, message in MESSAGES.placing(moment, stamp, self._instruments):
            self._publishers[topic].publish(message)

    def publish_world(self, world: World) -> None:
        """Publish the world once; latched."""
        self._world.publish(world_marker(world, MAP_FRAME, self._origin))

    def publish_progress(self, share: float) -> None:
        """Publish the completed share of the script; 1 at its end."""
        self._progress.publish(Float32(data=share))

    def publish(self, moment: Moment, stamp: rospy.Time) -> None:
        """Publish everything that belongs to a moment."""
        self.publish_clock(stamp)
        for topic, message in MESSAGES.at(moment, stamp, self._max_range, self._instruments, self._origin):
            self._publishers[topic].publish(message)
            if topic == topics.VELOCITY and self._commands is not None:
                self._commands.publish(message)


def _publisher(topic: str, kind: str) -> rospy.Publisher:
    return rospy.Publisher(topic, CLASSES[kind], queue_size=_QUEUE_SIZE, tcp_nodelay=True)
