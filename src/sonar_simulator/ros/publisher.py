"""What the simulator publishes: moments, the clock, the world, and where its sonar truly is."""

from typing import Dict, List, Tuple

import numpy as np
import rosgraph
import rospy
import tf2_ros
from genpy import Message
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Twist, Vector3
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import ColorRGBA, Float32, Float64
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from node_support import topics
from recordings.bags.messages import Placing
from sonar_simulator.simulation.moment_messages import MAP_FRAME, TOPICS, MomentMessages, map_origin
from sonar_simulator.simulation.simulation import Drive, Head, Moment, Simulation, SimulatorParameters
from sonar_simulator.world.world import World, world_triangles
from underwater_map_construction.msg import SonarScanLine

CLASSES: Dict[str, type] = {
    kind._type: kind for kind in (Float64, Imu, JointState, Odometry, SonarScanLine, TFMessage, TransformStamped, Twist)
}
"""By their names."""


MESSAGES = MomentMessages(lambda kind: CLASSES[kind](), lambda values: values.tobytes())
"""Fills in messages of rospy."""
# Transparent, because the map grows on the world and must be visible through it.
_OPACITY = 0.45


def world_marker(world: World, frame_id: str, origin: np.ndarray) -> Marker:
    """Return all triangles of a world; stamped 0, so that rviz places it at any time.

    origin: (3,) m, where the frame begins in the world.
    """
    points, colours = world_triangles(world)
    marker = Marker(ns="world", type=Marker.TRIANGLE_LIST, action=Marker.ADD, frame_locked=True)
    marker.header.frame_id = frame_id
    marker.pose = Pose(position=Point(*(-origin).tolist()), orientation=Quaternion(w=1.0))
    marker.scale = Vector3(1.0, 1.0, 1.0)
    marker.color = ColorRGBA(1.0, 1.0, 1.0, _OPACITY)
    marker.points = [Point(*corner) for corner in points.tolist()]
    marker.colors = [ColorRGBA(red, green, blue, _OPACITY * a) for red, green, blue, a in colours.tolist()]
    return marker


WORLD_FRAME = "world"
TRUE_SONAR_FRAME = "true_sonar"
_QUEUE_SIZE = 1000  # A second of every topic at the usual rates and ten times the real time


class SimulatorPublisher:
    """The simulator's topics. Its world is in the frame `map`, from which `odom` drifts away by the odometry's error.

    If the vehicle follows a script, nobody sends commands; the velocity is then also published on cmd_vel, where other
    nodes expect it. For an emulated head there is world -> true_sonar, and world -> map as where the vehicle's map
    begins, so that both have one root.
    """

    def __init__(self, simulation: Simulation, parameters: SimulatorParameters) -> None:
        self._simulation = simulation
        self._instruments = parameters.instruments
        self._origin = map_origin(simulation.T_world_start, self._instruments)
        self._T_world_map = np.eye(4)
        self._T_world_map[:3, 3] = self._origin
        self._clock = rospy.Publisher(topics.CLOCK, Clock, queue_size=_QUEUE_SIZE)
        self._progress = rospy.Publisher("~progress", Float32, queue_size=1, latch=True)
        self._world = rospy.Publisher("~world", Marker, queue_size=1, latch=True)
        self._world.publish(world_marker(simulation.world, MAP_FRAME, self._origin))
        kinds = TOPICS[self._instruments]
        self._publishers = {topic: _publisher(topic, kind) for topic, kind in kinds.items()}
        is_told = parameters.drive is Drive.SCRIPT and topics.VELOCITY in kinds
        self._commands = _publisher(topics.VELOCITY_COMMANDS, kinds[topics.VELOCITY]) if is_told else None
        self._broadcaster = tf2_ros.TransformBroadcaster() if parameters.head is Head.EMULATED else None

    @property
    def has_listener(self) -> bool:
        return self._publishers[topics.BEAMS].get_num_connections() > 0

    def lacks_listeners(self) -> bool:
        """Return whether somebody who subscribes is not connected yet, or nobody takes the heading; asks the master."""
        try:
            subscribers = {topic: len(nodes) for topic, nodes in rosgraph.Master(rospy.get_name()).getSystemState()[1]}
        except (OSError, rosgraph.MasterException):
            return False
        made = [*self._publishers.values(), *([] if self._commands is None else [self._commands])]
        heading = self._publishers.get(topics.HEADING)
        return (heading is not None and not heading.get_num_connections()) or any(
            one.get_num_connections() < subscribers.get(one.resolved_name, 0) for one in made
        )

    def publish_progress(self, share: float) -> None:
        """Publish the completed share of the script; 1 at its end."""
        self._progress.publish(Float32(data=share))

    def publish_rest(self, moment: Moment, stamp: rospy.Time) -> None:
        """Publish what places a waiting sonar: the time, and the vehicle and its servo at a moment."""
        self._publish(moment, stamp, MESSAGES.placing(moment, stamp, self._instruments))

    def publish(self, moment: Moment, stamp: rospy.Time) -> None:
        max_range = self._simulation.sonar.max_range
        self._publish(moment, stamp, MESSAGES.at(moment, stamp, max_range, self._instruments, self._origin))

    def _publish(self, moment: Moment, stamp: rospy.Time, messages: List[Tuple[str, Message]]) -> None:
        # Before the clock, so that a beam that is stamped with it is heard from where the sonar was then.
        if self._broadcaster is not None:
            poses = {TRUE_SONAR_FRAME: self._simulation.sonar_pose(moment), MAP_FRAME: self._T_world_map}
            self._broadcaster.sendTransform(
                [MESSAGES.transform(Placing.of(pose), stamp, WORLD_FRAME, frame) for frame, pose in poses.items()]
            )
        self._clock.publish(Clock(clock=stamp))
        for topic, message in messages:
            self._publishers[topic].publish(message)
            if topic == topics.VELOCITY and self._commands is not None:
                self._commands.publish(message)


def _publisher(topic: str, kind: str) -> rospy.Publisher:
    return rospy.Publisher(topic, CLASSES[kind], queue_size=_QUEUE_SIZE, tcp_nodelay=True)
