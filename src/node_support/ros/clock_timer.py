"""A timer that follows ROS time, however that jumps."""

import threading
import time
from typing import Callable

import rospy

from node_support.health import Health
from node_support.ros.node import guarded

_LONGEST_WAIT = 0.1  # s of wall time: the end of the node is noticed within this time


def every_clock_period(period: float, callback: Callable[[], None], health: Health) -> threading.Thread:
    """Call back every `period` seconds of ROS time until shutdown, at once when that jumps, never while it stands.

    The thread of rospy.Timer ends when simulated time jumps back while it waits for a time that is far ahead.
    """
    call = guarded(health, callback)

    def loop() -> None:
        due = rospy.get_time()
        while not rospy.core.is_shutdown_requested():
            now = rospy.get_time()
            if due - period <= now < due:
                _wait(due - now)
                continue
            due = due + period if 0.0 <= now - due < period else now + period
            call()

    thread = threading.Thread(target=loop, daemon=True)
    thread.start()
    return thread


def _wait(seconds: float) -> None:
    """Wait until ROS time may have advanced by `seconds`."""
    if rospy.rostime.is_wallclock():
        time.sleep(min(seconds, _LONGEST_WAIT))
    else:
        news = rospy.rostime.get_rostime_cond()
        with news:
            news.wait(_LONGEST_WAIT)
