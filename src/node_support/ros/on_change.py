"""Calls back as soon as something changed, but not too often."""

import threading
import time
from typing import Callable

import rospy

from node_support.health import Health
from node_support.ros.node import guarded

_LONGEST_WAIT = 0.1  # s: the end of the node is noticed within this time


def on_change(period: float, callback: Callable[[], None], health: Health) -> Callable[[], None]:
    """Return a function that tells of a change: the callback follows at once, in a thread of its own.

    Two answers to changes are at least `period` seconds of wall time apart; one answers all changes since the last.
    Where nothing changes the callback is called every `period` too, for it may have put off a part of its work.
    """
    news = threading.Event()
    call = guarded(health, callback)

    def loop() -> None:
        answered = called = time.monotonic() - period
        while not rospy.core.is_shutdown_requested():
            rest = answered + period - time.monotonic()
            if rest > 0.0:
                time.sleep(min(rest, _LONGEST_WAIT))
            elif news.wait(_LONGEST_WAIT):
                news.clear()
                answered = called = time.monotonic()
                call()
            elif time.monotonic() - called >= period:
                called = time.monotonic()
                call()

    threading.Thread(target=loop, daemon=True).start()
    return news.set
