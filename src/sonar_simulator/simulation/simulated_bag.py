"""Writes the bag of a whole simulation."""

from pathlib import Path
from typing import Any, Callable, Dict, List, Sequence, Tuple

import numpy as np
import yaml

from node_support import topics
from node_support.files import whole_file
from recordings.bags.bag_writer import BagWriter, PackedMessages
from sonar_simulator.simulation.moment_messages import MomentMessages, map_origin
from sonar_simulator.simulation.simulation import Moment, stacked
from sonar_simulator.simulation.simulation_setup import BASE_FRAME, SONAR_FRAME, Settings, Setup
from sonar_simulator.vehicle.robot_description import RobotDescription
from sonar_simulator.vehicle.servo import tilted

START_TIME = 1000.0  # s: stamps before it, as of late transforms, are still above 0
BEAMS_AT_ONCE = 120  # Beams cast together: one revolution of the usual head
_RENAMED = {topics.VELOCITY: topics.VELOCITY_COMMANDS}
_SETTINGS_TOPIC = "/sonar_simulator/settings"


class SimulatedBag:
    """Writes moments into a bag, at the times and on the topics that the simulator node would use."""

    def __init__(self, bag: BagWriter, setup: Setup, settings: Settings) -> None:
        self._bag = bag
        self._setup = setup
        self._settings = settings
        self._messages = MomentMessages(bag.make, np.asarray)
        self._origin = map_origin(setup.T_world_start, settings.simulator.instruments)

    def begin(self, robot: RobotDescription) -> None:
        """Write what applies to the whole bag: the fixed transforms and the parameters."""
        stamp_ns = _stamp_ns(0.0)
        stamp = self._bag.time(stamp_ns)
        transforms = [
            self._messages.transform(joint.T_parent_child, stamp, joint.parent, joint.child)
            for joint in robot.fixed_joints
        ]
        self._write(topics.STATIC_TRANSFORMS, self._messages.transforms(transforms), stamp_ns)
        told = self._bag.make("std_msgs/String")
        told.data = _told(self._settings)
        self._write(_SETTINGS_TOPIC, told, stamp_ns)

    def add(self, moments: Sequence[Moment]) -> None:
        """Write everything that belongs to moments, one after the other; the transforms of a moment are one message."""
        kinds: Dict[Tuple[bool, bool], List[int]] = {}
        for number, moment in enumerate(moments):
            kinds.setdefault((moment.is_tick, moment.ping is not None), []).append(number)
        packed: Dict[int, Tuple[List[PackedMessages], int]] = {}
        for numbers in kinds.values():
            topics_of_kind = self._packed(stacked([moments[number] for number in numbers]))
            packed.update((number, (topics_of_kind, place)) for place, number in enumerate(numbers))
        for number in range(len(moments)):
            topics_of_kind, place = packed[number]
            for messages in topics_of_kind:
                self._bag.append(messages, place)

    def _packed(self, moment: Moment) -> List[PackedMessages]:
        """Return the messages of moments of a kind, topic by topic."""
        stamps_ns = np.array([_stamp_ns(seconds) for seconds in moment.time.tolist()])
        stamp = self._bag.time(stamps_ns)
        instruments = self._settings.simulator.instruments
        messages = self._messages.at(moment, stamp, self._setup.sonar.max_range, instruments, self._origin)
        if messages[0][0] != topics.TRANSFORMS:
            messages.insert(0, (topics.TRANSFORMS, self._messages.transforms([])))
        messages[0][1].transforms.append(self._mounts(moment.tilt, stamp))
        return [self._bag.pack(_name(topic), message, stamps_ns) for topic, message in messages]

    def _mounts(self, tilts: np.ndarray, stamp: Any) -> Any:
        """Return the sonar's mount at each of the tilts (n,) as one message."""
        angles, places = np.unique(tilts, return_inverse=True)
        poses = np.array([tilted(self._setup.T_base_sonar, angle) for angle in angles])
        return self._messages.transform(poses[places], stamp, BASE_FRAME, SONAR_FRAME)

    def _write(self, topic: str, message: Any, stamp_ns: int) -> None:
        self._bag.write(_name(topic), message, stamp_ns)


def _stamp_ns(seconds: float) -> int:
    return round(float(START_TIME + seconds) * 1e9)


def _name(topic: str) -> str:
    """Return a topic of the simulator as the bag has it."""
    topic = _RENAMED.get(topic, topic)
    return topic if topic.startswith("/") else f"/{topic}"


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
        for moments in setup.simulation.batches(settings.simulator.clock_rate, BEAMS_AT_ONCE):
            if moments:
                writer.add(moments)
                beams += sum(moment.ping is not None for moment in moments)
                tell(moments[-1].time)
    return beams


def _told(settings: Settings) -> str:
    """Return the settings as yaml, with file names only, so that the bag does not depend on the folder."""
    values = settings.to_mapping()
    files = {key: Path(values[key]).name for key in ("world", "script")}
    return yaml.safe_dump({**values, **files}, sort_keys=False)
