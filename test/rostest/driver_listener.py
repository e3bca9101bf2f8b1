"""What the tests of the driver's nodes share: messages collected as they come, and waits for them."""

import threading
from typing import Any, Callable, Dict, List

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graph import PATIENCE

from underwater_map_construction.msg import SonarScanLine


class Listener:
    """Collects messages of a topic in `received`."""

    def __init__(self, topic: str, kind: type, wanted: Callable[[Any], bool] = lambda _: True) -> None:
        self.received: List[Any] = []
        self._news = threading.Condition()
        self._wanted = wanted
        self._subscriber = rospy.Subscriber(topic, kind, self._take, queue_size=1000)

    def wait(self, ready: Callable[[List[Any]], bool], timeout: float = PATIENCE) -> bool:
        """Wait until the messages satisfy `ready`; return whether they do."""
        with self._news:
            return self._news.wait_for(lambda: ready(self.received), timeout)

    def wait_for_more(self, count: int = 1, timeout: float = PATIENCE) -> List[Any]:
        """Return the next `count` messages; fails when they do not come."""
        with self._news:
            start = len(self.received)
        assert self.wait(lambda received: len(received) >= start + count, timeout), f"no {count} messages"
        return self.received[start : start + count]

    def wait_for_publisher(self) -> None:
        """Wait until somebody publishes."""
        while not self._subscriber.get_num_connections() and not rospy.is_shutdown():
            rospy.rostime.wallsleep(0.01)

    def close(self) -> None:
        """Take no more messages; a later publisher of this process must not mistake this for its reader."""
        self._subscriber.unregister()

    def _take(self, message: Any) -> None:
        if not self._wanted(message):
            return
        with self._news:
            self.received.append(message)
            self._news.notify_all()


def beams() -> Listener:
    """Return a listener of the driver's beams."""
    return Listener("sonar/raw", SonarScanLine)


def diagnostics(name: str = "imagenex_852_driver") -> Listener:
    """Return a listener of the diagnostics of one node."""

    def is_of_node(array: DiagnosticArray) -> bool:
        return any(status.name.endswith(f": {name}") and status.values for status in array.status)

    return Listener("/diagnostics", DiagnosticArray, is_of_node)


def values(array: DiagnosticArray) -> Dict[str, str]:
    """Return the keys and values of an array's first status."""
    return {pair.key: pair.value for pair in array.status[0].values}


def level(array: DiagnosticArray) -> int:
    """Return the level of an array's first status, as an integer in every version of the message."""
    value = array.status[0].level
    return value[0] if isinstance(value, bytes) else value


ERROR = DiagnosticStatus.ERROR[0] if isinstance(DiagnosticStatus.ERROR, bytes) else DiagnosticStatus.ERROR
