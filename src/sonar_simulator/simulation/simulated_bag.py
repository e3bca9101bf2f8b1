"""Writes the bag of a whole simulation."""

import math
from itertools import cycle
from pathlib import Path
from typing import Any, Callable, Dict, Iterator

import numpy as np
import yaml

from node_support import topics
from node_support.files import whole_file
from recordings.bags.bag_writer import BagWriter
from sonar_simulator.simulation.moment_messages import MomentMessages
from sonar_simulator.simulation.simulation import Moment
from sonar_simulator.simulation.simulation_setup import BASE_FRAME, SONAR_FRAME, Settings, Setup
from sonar_simulator.vehicle.robot_description import RobotDescription
from sonar_simulator.vehicle.servo import tilted

START_TIME = 1000.0  # s: stamps before it, as of late transforms, are still above 0
BEAMS_AT_ONCE = 120  # Beams cast together: one revolution of the usual head
_OF_A_KIND = 4  # Messages of one type that a moment has at most, and some to spare
_RENAMED = {topics.VELOCITY: topics.VELOCITY_COMMANDS}
_SETTINGS_TOPIC = "/sonar_simulator/settings"


class ReusedMessages:
    """Gives messages of a moment again, filled in as they were, for a later one: making them takes longer than writing.

    Whoever fills them in must set the same fields each time, and write them before the next moment.
    """

    def __init__(self, make: Callable[[str], Any]) -> None:
        """`make` returns an empty message of a type, package/Name."""
        self._make = make
        self._made: Dict[str, Iterator[Any]] = {}

    def __call__(self, kind: str) -> Any:
        """Return a message of a type."""
        if kind not in self._made:
            self._made[kind] = cycle([self._make(kind) for _ in range(_OF_A_KIND)])
        return next(self._made[kind])


class SimulatedBag:
    """Writes moments into a bag, at the times and on the topics that the simulator node would use."""

    def __init__(self, bag: BagWriter, setup: Setup, settings: Settings) -> None:
        self._bag = bag
        self._setup = setup
        self._settings = settings
        self._messages = MomentMessages(bag.make, np.asarray)
        self._of_moment = MomentMessages(ReusedMessages(bag.make), np.asarray)
        self._tilt = math.nan
        self._mount: Any = None

    def begin(self, robot: RobotDescription) -> None:
        """Write what applies to the whole bag: the fixed transforms and the parameters."""
        stamp_ns, stamp = self._stamp(0.0)
        transforms = [
            self._messages.transform(joint.T_parent_child, stamp, joint.parent, joint.child)
            for joint in robot.fixed_joints
        ]
        self._write(topics.STATIC_TRANSFORMS, self._messages.transforms(transforms), stamp_ns)
        told = self._bag.make("std_msgs/String")
        told.data = _told(self._settings)
        self._write(_SETTINGS_TOPIC, told, stamp_ns)

    def add(self, moment: Moment) -> None:
        """Write everything that belongs to a moment; its transforms are one message."""
        stamp_ns, stamp = self._stamp(moment.time)
        instruments = self._settings.simulator.instruments
        messages = self._of_moment.at(moment, stamp, self._setup.sonar.max_range, instruments)
        if messages[0][0] != topics.TRANSFORMS:
            messages.insert(0, (topics.TRANSFORMS, self._messages.transforms([])))
        messages[0][1].transforms.append(self._mount_at(moment.tilt, stamp))
        for topic, message in messages:
            self._write(_RENAMED.get(topic, topic), message, stamp_ns)

    def _mount_at(self, tilt: float, stamp: Any) -> Any:
        """Return the sonar's mount as a message, which is written before the next one is asked for."""
        if tilt != self._tilt:
            pose = tilted(self._setup.T_base_sonar, tilt)
            self._tilt, self._mount = tilt, self._messages.transform(pose, stamp, BASE_FRAME, SONAR_FRAME)
        self._mount.header.stamp = stamp
        return self._mount

    def _stamp(self, seconds: float) -> Any:
        stamp_ns = round(float(START_TIME + seconds) * 1e9)
        return stamp_ns, self._bag.time(stamp_ns)

    def _write(self, topic: str, message: Any, stamp_ns: int) -> None:
        self._bag.write(topic if topic.startswith("/") else f"/{topic}", message, stamp_ns)


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
    with whole_file(path) as temporary, BagWriter(temporary, compression) as bag:
        writer = SimulatedBag(bag, setup, settings)
        writer.begin(robot)
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
