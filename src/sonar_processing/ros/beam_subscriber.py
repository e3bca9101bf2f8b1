"""Listens to the sonar's beams."""

from typing import Callable

import rospy

from node_support import topics
from underwater_map_construction.msg import SonarScanLine

_BUFFER_BYTES = 2**20


def subscribe_to_beams(callback: Callable[[SonarScanLine], None], queue_size: int = 200) -> rospy.Subscriber:
    """Subscribe to the beams without delay."""
    return rospy.Subscriber(
        topics.BEAMS,
        SonarScanLine,
        callback,
        queue_size=queue_size,
        buff_size=_BUFFER_BYTES,
        tcp_nodelay=True,
    )
