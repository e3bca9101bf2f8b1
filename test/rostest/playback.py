"""Plays a bag to nodes that may be slow: it waits for what they make of it, so that none falls behind."""

import threading
from argparse import Namespace
from collections import deque
from functools import lru_cache
from pathlib import Path
from typing import Callable, List, Sequence, Tuple

import genpy
import rospy
from graph import nodes_of, wait_for_links
from rosgraph_msgs.msg import Clock

from node_support import topics
from node_support.timing import Pace
from recordings.ros.play_bag import Played, read_messages

# Of a burst after a stop of this process no message may be lost.
QUEUE_SIZE = 100000


Step = Tuple[float, Callable[[], object]]
"""What is waited for before messages that were recorded after a time [s] are played."""


def play(bag: Path, rate: float, steps: Sequence[Step], listeners: int = 1) -> None:
    """Publish the messages of a bag and the clock to all who listen, `rate` times as fast as they were recorded.

    It begins when so many listeners of beams, and every listener of the other topics, are connected, and stops at each
    of the steps, which are in the order of time.
    """
    messages, left = _messages(bag), deque(steps)
    kinds = {topics.CLOCK: Clock, **{played.topic: type(played.message) for played in messages}}
    publishers = {topic: _publisher(topic, kind) for topic, kind in kinds.items()}
    wait_for_links("/sonar/raw", listeners)
    for topic in publishers:
        wait_for_links(topic, len(nodes_of(topic)[1]))
    start, now, pace = messages[0].time, -1.0, Pace(rate, threading.Event().wait)
    for played in messages:
        while left and played.time > left[0][0]:
            left.popleft()[1]()
        pace.wait_for(played.time - start)
        if played.time > now:
            now = played.time
            publishers[topics.CLOCK].publish(Clock(genpy.Time.from_sec(now)))
        publishers[played.topic].publish(played.message)
    for _, wait in left:
        wait()


@lru_cache(maxsize=1)
def _messages(bag: Path) -> List[Played]:
    return read_messages(Namespace(bag=bag, topics=None, ned=False))


def _publisher(topic: str, kind: type) -> rospy.Publisher:
    return rospy.Publisher(topic, kind, queue_size=QUEUE_SIZE, latch=topic == topics.STATIC_TRANSFORMS)
