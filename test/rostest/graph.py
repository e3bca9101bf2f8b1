"""What the rostests share: waiting for events, playing bags, reading diagnostics and maps."""

import os
import subprocess
import threading
import unittest
import xmlrpc.client
from pathlib import Path
from typing import Any, Callable, Dict, List
from xml.sax.saxutils import quoteattr

import numpy as np
import rosbag
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import SetBool

PACKAGE_ROOT = Path(__file__).resolve().parents[2]
TEST_DATA = PACKAGE_ROOT / "test/data"


def recording(name: str) -> Path:
    """Return the path of a real recording; skips the test, saying so, where it is absent."""
    folder = Path(os.environ.get("UMC_DATA", str(PACKAGE_ROOT.parent / "shared/data")))
    path = folder / name
    if not path.is_file():
        reason = f"{name} is not in {folder}; set UMC_DATA to the folder of the recordings"
        _report_skip(path.stem, reason)
        raise unittest.SkipTest(reason)
    return path


def _report_skip(name: str, reason: str) -> None:
    """Leave a result beside rosunit's own, which knows no skipped tests and would leave them out."""
    case = f'<testcase classname="recording" name="{name}"><skipped message={quoteattr(reason)}/></testcase>'
    folder = Path(os.environ.get("ROS_TEST_RESULTS_DIR", "/tmp"))
    (folder / f"rosunit-skipped-{name}.xml").write_text(f'<testsuite tests="1">{case}</testsuite>')


class Inbox:
    """What came on a topic, and a wait for a message that fits."""

    def __init__(self, topic: str, kind: Any) -> None:
        self._topic = topic
        self._condition = threading.Condition()
        self._messages: List[Any] = []
        self._subscriber = rospy.Subscriber(topic, kind, self._take, queue_size=1000)

    @property
    def messages(self) -> List[Any]:
        """A copy of all that came so far: it does not grow while a test looks at it."""
        with self._condition:
            return list(self._messages)

    def close(self) -> None:
        """Stop listening: rospy connects a process once per topic, so that only then the next Inbox is a newcomer."""
        self._subscriber.unregister()

    def _take(self, message: Any) -> None:
        with self._condition:
            self._messages.append(message)
            self._condition.notify_all()

    def wait_for_link(self, timeout: float = 20.0) -> None:
        """Wait until a publisher is connected, so that no message is missed from then on."""
        ended = threading.Event()
        for _ in range(int(timeout / 0.05)):
            if self._subscriber.get_num_connections():
                return
            ended.wait(0.05)
        raise AssertionError(f"{self._topic}: nobody publishes it after {timeout} s")

    def wait_for(self, fits: Callable[[Any], bool] = lambda _: True, timeout: float = 20.0) -> Any:
        """Return the newest message once it fits; raises AssertionError after `timeout` seconds of wall time."""
        with self._condition:
            if self._condition.wait_for(lambda: bool(self._messages) and fits(self._messages[-1]), timeout):
                return self._messages[-1]
        raise AssertionError(f"{self._topic}: nothing that fits in {timeout} s; {len(self._messages)} messages came")


class Diagnostics:
    """The counters that the nodes publish."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._values: Dict[str, Dict[str, str]] = {}
        self._subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self._take, queue_size=100)

    def _take(self, array: DiagnosticArray) -> None:
        with self._condition:
            for status in array.status:
                stage = status.name.rpartition(": ")[2]
                self._values[stage] = {item.key: item.value for item in status.values}
            self._condition.notify_all()

    def wait_for(self, stage: str, counter: str, number: int, timeout: float = 20.0) -> None:
        """Wait until a counter has reached `number`; raises AssertionError with what is known of the stage."""
        with self._condition:
            if self._condition.wait_for(lambda: self._number(stage, counter) >= number, timeout):
                return
            known = self._values.get(stage)
        raise AssertionError(f"{stage}: {counter} is not {number} after {timeout} s: {known}")

    def values(self, stage: str) -> Dict[str, str]:
        """Return what is known of a stage now."""
        with self._condition:
            return dict(self._values.get(stage, {}))

    def _number(self, stage: str, counter: str) -> int:
        return int(self._values.get(stage, {}).get(counter, -1))


def wait_for_subscribers(topic: str, number: int, timeout: float = 20.0) -> None:
    """Wait until `number` nodes listen to a topic and every publisher that it has is connected to all of them."""
    ended = threading.Event()
    for _ in range(int(timeout / 0.1)):
        publishers, subscribers, _ = rosgraph.Master("/graph_test").getSystemState()
        listeners = dict(subscribers).get(topic, [])
        if len(listeners) >= number and all(_links(node, topic) >= number for node in dict(publishers).get(topic, [])):
            return
        ended.wait(0.1)
    raise AssertionError(f"{topic}: not {number} connected listeners after {timeout} s")


def _links(node: str, topic: str) -> int:
    """Return the number of established connections over which a node publishes a topic."""
    slave = xmlrpc.client.ServerProxy(rosgraph.Master("/graph_test").lookupNode(node))
    _, _, connections = slave.getBusInfo("/graph_test")
    return sum(1 for link in connections if link[2] == "o" and link[4] == topic and link[5])


def wait_until(holds: Callable[[], bool], timeout: float = 20.0, required: bool = True) -> bool:
    """Wait until a state holds that nobody tells of, and return whether it does.

    Raises AssertionError after `timeout` seconds where it is `required`.
    """
    ended = threading.Event()
    for _ in range(int(timeout / 0.02)):
        if holds():
            return True
        ended.wait(0.02)
    if required:
        raise AssertionError(f"not after {timeout} s")
    return False


def play(bag: Path, rate: float, longest: float = 120.0) -> None:
    """Play a bag to its end, in at most `longest` s, to all who listen.

    Playback starts when every listener is connected to every topic.
    """
    command = ["rosbag", "play", "--quiet", "--clock", "--pause", f"--rate={rate}", str(bag), "__name:=player"]
    player = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        rospy.wait_for_service("/player/pause_playback", timeout=20.0)
        _, subscribers, _ = rosgraph.Master("/graph_test").getSystemState()
        for topic in _topics(bag):
            wait_for_subscribers(topic, len(dict(subscribers).get(topic, [])))
        rospy.ServiceProxy("/player/pause_playback", SetBool)(False)
        assert player.wait(timeout=longest) == 0
    finally:
        player.kill()


def _topics(bag: Path) -> List[str]:
    with rosbag.Bag(str(bag)) as recorded:
        return sorted(recorded.get_type_and_topic_info().topics)


def rows(cloud: Any) -> np.ndarray:
    """Return the points of a float32 PointCloud2 as (n, fields), sorted, so that clouds can be compared."""
    data = np.frombuffer(cloud.data, dtype=np.float32).reshape(-1, len(cloud.fields))
    return data[np.lexsort(data.T[::-1])]


def wait_for_publisher_links(publisher: rospy.Publisher, number: int, timeout: float = 20.0) -> None:
    """Wait until `number` nodes are connected to a publisher of this process."""
    ended = threading.Event()
    for _ in range(int(timeout / 0.05)):
        if publisher.get_num_connections() >= number:
            return
        ended.wait(0.05)
    raise AssertionError(f"{publisher.name}: not {number} connections after {timeout} s")
