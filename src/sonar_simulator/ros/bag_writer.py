"""Writes the bag of a whole simulation, without a ROS master."""

import math
from pathlib import Path
from typing import Callable

import rosbag
import rospy
import yaml
from geometry_msgs.msg import Pose
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from node_support import topics
from node_support.files import whole_file
from node_support.ros.conversions import pose_from_matrix
from sonar_simulator.ros.simulator_messages import moment_messages, transform_message
from sonar_simulator.simulation.simulation import Moment
from sonar_simulator.simulation.simulation_setup import BASE_FRAME, SONAR_FRAME, Settings, Setup
from sonar_simulator.vehicle.robot_description import RobotDescription
from sonar_simulator.vehicle.servo import tilted

START_TIME = 1000.0  # s: stamps before it, as of late transforms, are still above 0
BEAMS_AT_ONCE = 120  # Beams cast together: one revolution of the usual head
_RENAMED = {topics.VELOCITY: topics.VELOCITY_COMMANDS}
_SETTINGS_TOPIC = "/sonar_simulator/settings"


class _Stamp(rospy.Time):
    """A time that compares fast: rosbag sorts every message into an index of all earlier messages."""

    __slots__ = ()

    def __lt__(self, other: rospy.Time) -> bool:
        return (self.secs, self.nsecs) < (other.secs, other.nsecs)


class BagWriter:
    """Writes moments into a bag, at the times and on the topics that the simulator node would use."""

    def __init__(self, bag: rosbag.Bag, setup: Setup) -> None:
        self._bag = bag
        self._setup = setup
        self._tilt = math.nan
        self._pose = Pose()

    def begin(self, robot: RobotDescription, settings: Settings) -> None:
        """Write what applies to the whole bag: the fixed transforms and the parameters."""
        start = _stamp(0.0)
        transforms = [
            transform_message(pose_from_matrix(joint.T_parent_child), start, joint.parent, joint.child)
            for joint in robot.fixed_joints
        ]
        self._write(topics.STATIC_TRANSFORMS, TFMessage(transforms=transforms), start)
        self._write(_SETTINGS_TOPIC, String(data=_told(settings)), start)

    def add(self, moment: Moment) -> None:
        """Write everything that belongs to a moment; its transforms are one message."""
        stamp = _stamp(moment.time)
        for topic, message in moment_messages(moment, stamp, self._setup.sonar.max_range):
            if topic == topics.TRANSFORMS:
                message.transforms.append(transform_message(self._mount(moment.tilt), stamp, BASE_FRAME, SONAR_FRAME))
            self._write(_RENAMED.get(topic, topic), message, stamp)

    def _mount(self, tilt: float) -> Pose:
        if tilt != self._tilt:
            self._tilt, self._pose = tilt, pose_from_matrix(tilted(self._setup.T_base_sonar, tilt))
        return self._pose

    def _write(self, topic: str, message: object, stamp: rospy.Time) -> None:
        self._bag.write(topic if topic.startswith("/") else f"/{topic}", message, stamp)


def write_bag(
    path: Path,
    setup: Setup,
    settings: Settings,
    robot: RobotDescription,
    compression: str = "none",
    tell: Callable[[float], object] = lambda time: None,
) -> int:
    """Write the bag of a simulation that ends, completely or not at all; return the number of its beams.

    `tell` receives the simulated time [s] from time to time. Raises OSError.
    """
    beams = 0
    with whole_file(path) as temporary, rosbag.Bag(str(temporary), "w", compression=compression) as bag:
        writer = BagWriter(bag, setup)
        writer.begin(robot, settings)
        for moment in setup.simulation.moments(settings.simulator.clock_rate, BEAMS_AT_ONCE):
            writer.add(moment)
            if moment.ping is not None:
                beams += 1
                tell(moment.time)
    return beams


def _told(settings: Settings) -> str:
    """Return the settings as yaml, with file names only, so that the bag does not depend on the folder."""
    values = settings.to_mapping()
    files = {key: Path(values[key]).name for key in ("world", "script")}
    return yaml.safe_dump({**values, **files}, sort_keys=False)


def _stamp(seconds: float) -> rospy.Time:
    return _Stamp.from_sec(START_TIME + seconds)
