"""Plays a bag with a clock that never stops before its end, however slow bag, machine and listeners are."""

import threading
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Any, List, Union

import genpy
import rosbag
import rospy
from geometry_msgs.msg import Quaternion, Vector3
from rosgraph_msgs.msg import Clock

from node_support import topics
from node_support.help import CommandLine, positive
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.node import LAST_MESSAGES_ARRIVE, StartError, run
from node_support.timing import Pace
from sonar_processing.beams.beam_types import BEAM_TYPES

_CLOCK_PERIOD = 0.01  # s of wall time: as rosbag play does
_WAIT_STEP = 0.05  # s: soon enough for a person
_LATECOMERS = 5.0  # s: a node that the master still lists may have died, and will never connect
_QUEUE_SIZE = 1000


def run_play_bag() -> None:
    options = play_arguments(rospy.myargv()[1:])
    run("play_bag", lambda: BagPlayer(options))


def play_arguments(arguments: List[str]) -> Namespace:
    """Return bag, rate, topics, ned, odom_frame and base_frame; exits on a bad command line."""
    parser = CommandLine(
        "play_bag", description="Play a ROS 1 bag with /clock, once every topic has a subscriber. It is read first."
    )
    parser.add_argument("bag", type=Path, help="bag to play")
    parser.add_argument("--rate", type=positive, default=1.0, help="times real time (default: 1)")
    parser.add_argument("--topics", nargs="+", help="play only these (default: all)")
    parser.add_argument("--ned", action="store_true", help="the odometry counts x north, y east, z down: turn it up")
    parser.add_argument("--odom-frame", default="odom", help="frame of the odometry that --ned turns (default: odom)")
    parser.add_argument("--base-frame", default="base_link", help="frame of the vehicle (default: base_link)")
    return parser.parse_args(arguments)


@dataclass(frozen=True)
class Played:
    """One message of a bag: when it was recorded [s], where it is published, and itself."""

    time: float
    topic: str
    message: Any


class BagPlayer:
    """Publishes the messages of a bag and /clock at their pace, then ends the node.

    `rosbag play` publishes /clock only while it waits for the next message. It reads every message when it is due, and
    where topics lie in chunks of their own it unpacks a chunk each time: with three such topics it fell behind at eight
    times real time, and /clock stood still from then on. This player reads the bag first, one topic after the other.
    """

    def __init__(self, options: Namespace) -> None:
        """Raises StartError for a bag that cannot be played."""
        self._options = options
        self.health = make_health("play_bag")
        self._messages = read_messages(options)
        self._clock = rospy.Publisher(topics.CLOCK, Clock, queue_size=_QUEUE_SIZE)
        kinds = {played.topic: type(played.message) for played in self._messages}
        self._publishers = {
            topic: rospy.Publisher(topic, kind, queue_size=_QUEUE_SIZE, latch=topic == topics.STATIC_TRANSFORMS)
            for topic, kind in kinds.items()
        }
        self._ended = threading.Event()
        rospy.on_shutdown(self._ended.set)
        threading.Thread(target=guarded(self.health, self._play), daemon=True).start()

    def _play(self) -> None:
        self._wait_for_subscribers()
        start, rate = self._messages[0].time, self._options.rate
        pace, ticks = Pace(rate, self._ended.wait), 0
        for played in self._messages:
            while not self._ended.is_set() and start + ticks * _CLOCK_PERIOD * rate <= played.time:
                self._tick(pace, ticks * _CLOCK_PERIOD * rate)
                ticks += 1
            pace.wait_for(played.time - start)
            if self._ended.is_set():
                return
            self._publishers[played.topic].publish(played.message)
            self.health.count("messages")
        seconds = self._messages[-1].time - start
        rospy.loginfo("%s has ended after %.0f s; the map stays, Ctrl-C ends it", self._options.bag, seconds)
        self._ended.wait(LAST_MESSAGES_ARRIVE)
        rospy.signal_shutdown("the bag has ended")

    def _tick(self, pace: Pace, since_start: float) -> None:
        if pace.wait_for(since_start):
            detail = f"{pace.lost:.1f} s in all: the machine cannot keep up with rate {self._options.rate:g}"
            self.health.problem("delays", f"{detail}; give a smaller one")
        self._clock.publish(Clock(genpy.Time.from_sec(self._messages[0].time + since_start)))

    def _wait_for_subscribers(self) -> None:
        """Keep the first messages from being played to nobody, or only to those that connect fast."""
        while not self._ended.wait(_WAIT_STEP):
            missing = [topic for topic, publisher in self._publishers.items() if not publisher.get_num_connections()]
            self.health.show("topics without subscriber", " ".join(missing))
            if not missing:
                break
        for _ in range(int(_LATECOMERS / _WAIT_STEP)):
            if self._are_all_connected() or self._ended.wait(_WAIT_STEP):
                return

    def _are_all_connected(self) -> bool:
        _, _, (_, subscribers, _) = rospy.get_master().getSystemState()
        known = {topic: len(nodes) for topic, nodes in subscribers}
        return all(
            publisher.get_num_connections() >= known.get(publisher.resolved_name, 0)
            for publisher in self._publishers.values()
        )


def read_messages(options: Namespace) -> List[Played]:
    """Return the messages of a bag in the order in which they were recorded; raises StartError."""
    try:
        with rosbag.Bag(str(options.bag)) as bag:
            found = bag.get_type_and_topic_info().topics
            chosen = [topic for topic in found if not options.topics or topic in options.topics]
            if not any(found[topic].msg_type in BEAM_TYPES for topic in chosen):
                held = ", ".join(f"{topic} ({found[topic].msg_type})" for topic in sorted(found))
                rospy.logwarn("%s: no topic that is played holds beams; the bag has %s", options.bag, held)
            played = [one for topic in chosen for one in _messages(bag, topic)]
    except rosbag.ROSBagUnindexedException:
        raise StartError(f"{options.bag}: not indexed, the recording was cut off; run: rosbag reindex") from None
    except OSError as error:
        advice = "" if options.bag.is_absolute() else "; give the whole path, since roslaunch starts nodes elsewhere"
        raise StartError(f"{options.bag.absolute()}: {error.strerror or error}{advice}") from None
    except (rosbag.ROSBagException, EOFError, ValueError) as error:
        raise StartError(f"{options.bag}: not a bag, or damaged: {error}") from None
    if not played:
        raise StartError(f"{options.bag}: no message on {' '.join(options.topics or ['any topic'])}")
    turned = [options.ned and turn_up(one.message, options.odom_frame, options.base_frame) for one in played]
    if options.ned and not any(turned):
        link = f"{options.odom_frame} -> {options.base_frame}"
        raise StartError(f"{options.bag}: --ned turns the pose {link}, which is neither in tf nor in an Odometry")
    return sorted(played, key=lambda one: one.time)


def _messages(bag: rosbag.Bag, topic: str) -> List[Played]:
    # One topic at a time: rosbag keeps one decompressed chunk, and topics often lie in chunks of their own.
    return [Played(time.to_sec(), topic, message) for _, message, time in bag.read_messages(topics=[topic])]


def turn_up(message: Any, odom_frame: str, base_frame: str) -> bool:
    """Turn what a TFMessage or Odometry says of the vehicle in odom, both frames by half a turn about x.

    Return whether there was such a pose; other messages stay as they are.
    """
    poses = [
        (one.transform.translation, one.transform.rotation)
        for one in getattr(message, "transforms", ())
        if (one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")) == (odom_frame, base_frame)
    ]
    if hasattr(message, "pose") and hasattr(message, "twist"):
        poses.append((message.pose.pose.position, message.pose.pose.orientation))
        for velocity in (message.twist.twist.linear, message.twist.twist.angular):
            _turn(velocity)
    for position, orientation in poses:
        _turn(position)
        _turn(orientation)
    return bool(poses)


def _turn(value: Union[Vector3, Quaternion]) -> None:
    value.y, value.z = -value.y, -value.z
