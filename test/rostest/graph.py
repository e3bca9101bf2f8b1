"""What the rostests share: waiting for events, launching nodes, reading diagnostics and maps."""

import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import xmlrpc.client
from contextlib import contextmanager
from http.client import HTTPException
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Set, Tuple, Type
from xml.sax.saxutils import quoteattr

import numpy as np
import rosgraph
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray

PACKAGE = "underwater_map_construction"
PACKAGE_ROOT = Path(__file__).resolve().parents[2]
TEST_DATA = PACKAGE_ROOT / "test/data"
# s: for an event that comes. A slow and busy machine takes a tenth of it to start one process.
PATIENCE = 180.0
# s: for the end of a simulation or a playback with which a machine cannot keep up.
LONG_PATIENCE = 600.0


def run(case: Type[unittest.TestCase], **options: Any) -> None:
    """Run the tests of a script under rostest; `options` are those of rospy.init_node."""
    name = Path(sys.argv[0]).stem
    rospy.init_node(name, **options)
    rostest.rosrun(PACKAGE, name, case, sys.argv)


def ended(command: List[str], seconds: float = PATIENCE, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Run a program that must end by itself; what it says on stderr is in its stdout too."""
    return subprocess.run(
        command, env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        timeout=seconds, check=False,
    )  # fmt: skip


def recording(name: str) -> Path:
    """Return the path of a real recording; skips the test, saying so, where it is absent."""
    folder = Path(os.environ.get("UMC_DATA", str(PACKAGE_ROOT.parent / "shared/data")))
    path = folder / name
    if not path.is_file():
        reason = f"{name} is not in {folder}; set UMC_DATA to the folder of the recordings"
        skip(path.stem, reason)
    return path


def skip(name: str, reason: str) -> None:
    """Skip a test, and leave a result beside rosunit's own, which knows no skipped tests and would leave them out."""
    case = f'<testcase classname="skipped" name="{name}"><skipped message={quoteattr(reason)}/></testcase>'
    folder = Path(os.environ.get("ROS_TEST_RESULTS_DIR", "/tmp"))
    (folder / f"rosunit-skipped-{name}.xml").write_text(f'<testsuite tests="1">{case}</testsuite>')
    raise unittest.SkipTest(reason)


def temporary_folder(clean_up: Callable[..., Any]) -> Path:
    """Return a folder that is removed at the end of the test, or class, whose `clean_up` is given."""
    folder = tempfile.mkdtemp()
    clean_up(shutil.rmtree, folder)
    return Path(folder)


class Inbox:
    """What came on a topic, and a wait for a message that fits."""

    def __init__(self, topic: str, kind: Any, wanted: Callable[[Any], bool] = lambda _: True) -> None:
        """`wanted`: returns whether a message is kept."""
        self._topic, self._wanted = topic, wanted
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
        if not self._wanted(message):
            return
        with self._condition:
            self._messages.append(message)
            self._condition.notify_all()

    def linked(self) -> "Inbox":
        """Wait until a publisher is connected and knows it, so that no message is missed from then on; return self."""
        topic, listener = self._subscriber.resolved_name, rospy.get_name()
        told = f"{topic}: nobody publishes it"
        wait_until(lambda: any(listener in _others(node, topic, "o") for node in nodes_of(topic)[0]), told=told)
        return self

    def wait_for(self, fits: Callable[[Any], bool] = lambda _: True, timeout: float = PATIENCE) -> Any:
        """Return the first message that fits, of the newest and of all that come after it.

        One that fits is found though others follow at once. Raises AssertionError after `timeout` s of wall time.
        """
        end = time.monotonic() + timeout
        with self._condition:
            seen = max(len(self._messages) - 1, 0)
            while True:
                found = next((message for message in self._messages[seen:] if fits(message)), None)
                if found is not None:
                    return found
                seen = len(self._messages)
                if not self._condition.wait(max(end - time.monotonic(), 0.0)):
                    raise AssertionError(f"{self._topic}: nothing that fits in {timeout} s; {seen} messages came")

    def wait_for_number(self, number: int, timeout: float = PATIENCE) -> List[Any]:
        """Return all messages once at least `number` have come; raises AssertionError after `timeout` seconds."""
        with self._condition:
            if self._condition.wait_for(lambda: len(self._messages) >= number, timeout):
                return list(self._messages)
            count = len(self._messages)
        raise AssertionError(f"{self._topic}: not {number} messages in {timeout} s but {count}")


class Diagnostics:
    """The counters that the nodes publish."""

    def __init__(self, node: str = "") -> None:
        """`node`: the only one whose counters are taken, by its full name; without it those of all."""
        self._node = node
        self.callers: Set[str] = set()
        """Full names of the nodes that have reported."""
        self._condition = threading.Condition()
        self._values: Dict[str, Dict[str, str]] = {}
        self._subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self._take, queue_size=100)

    def _take(self, array: DiagnosticArray) -> None:
        if self._node not in ("", array._connection_header["callerid"]):
            return
        with self._condition:
            self.callers.add(array._connection_header["callerid"])
            for status in array.status:
                stage = status.name.rpartition(": ")[2]
                self._values[stage] = {item.key: item.value for item in status.values}
            self._condition.notify_all()

    def wait_for(self, stage: str, counter: str, number: int, timeout: float = PATIENCE) -> None:
        """Wait until a counter has reached `number`; raises AssertionError with what is known of the stage."""
        if not self.reaches(stage, counter, number, timeout):
            raise AssertionError(f"{stage}: {counter} is not {number} after {timeout} s: {self.values(stage)}")

    def reaches(self, stage: str, counter: str, number: int, timeout: float) -> bool:
        """Return whether a counter reaches `number` within `timeout` s of wall time."""
        with self._condition:
            return self._condition.wait_for(lambda: self._number(stage, counter) >= number, timeout)

    def known(self, stage: str, counter: str) -> int:
        """Wait until a stage has reported, and return the counter as it is now, 0 where it has not begun to count."""
        with self._condition:
            assert self._condition.wait_for(lambda: stage in self._values, PATIENCE), f"{stage} reports nothing"
            return max(self._number(stage, counter), 0)

    def forget(self) -> None:
        """Forget all counters: the node that published them has ended."""
        with self._condition:
            self._values.clear()

    def values(self, stage: str) -> Dict[str, str]:
        """Return what is known of a stage now."""
        with self._condition:
            return dict(self._values.get(stage, {}))

    def all_values(self) -> Dict[str, Dict[str, str]]:
        """Return what is known of each stage now."""
        with self._condition:
            return dict(self._values)

    def _number(self, stage: str, counter: str) -> int:
        return int(self._values.get(stage, {}).get(counter, -1))


def publisher(topic: str, kind: type, listeners: int = 1) -> rospy.Publisher:
    """Return a publisher that so many nodes are connected to."""
    made = rospy.Publisher(topic, kind, queue_size=1000, tcp_nodelay=True)
    wait_for_listeners(made, listeners)
    return made


def wait_for_listeners(made: rospy.Publisher, number: int = 1) -> None:
    """Wait until `number` nodes are connected to a publisher of this process."""
    wait_until(lambda: made.get_num_connections() >= number, told=f"{made.name}: not {number} connections")


def wait_for_links(topic: str, number: int = 1) -> None:
    """Wait until somebody publishes a topic, `number` nodes listen to it, and all are connected."""

    def are_linked() -> bool:
        publishers, listeners = nodes_of(topic)
        is_heard = all(len(_others(node, topic, "o")) >= number for node in publishers)
        return bool(publishers) and len(listeners) >= number and is_heard

    wait_until(are_linked, told=f"{topic}: no publisher with {number} connected listeners")


def nodes_of(topic: str) -> Tuple[List[str], List[str]]:
    """Return the nodes that publish a topic, and those that listen to it."""
    publishers, subscribers, _ = rosgraph.Master("/graph_test").getSystemState()
    return dict(publishers).get(topic, []), dict(subscribers).get(topic, [])


def _others(node: str, topic: str, direction: str) -> List[str]:
    """Return the other end of each established connection over which a node publishes a topic, or takes it ("i").

    A node that ends meanwhile has none.
    """
    try:
        slave = xmlrpc.client.ServerProxy(rosgraph.Master("/graph_test").lookupNode(node))
        _, _, connections = slave.getBusInfo("/graph_test")
    except (OSError, HTTPException, rosgraph.MasterException):
        return []
    return [link[1] for link in connections if link[2] == direction and link[4] == topic and link[5]]


def wait_until(
    holds: Callable[[], bool], timeout: float = PATIENCE, required: bool = True, told: str = "not reached"
) -> bool:
    """Wait until a state holds that nobody tells of, and return whether it does.

    Raises AssertionError, which says what is `told`, after `timeout` seconds where it is `required`.
    To look takes about a tenth of the time: the master and the nodes that are asked have their own work.
    """
    ended, begin = threading.Event(), time.monotonic()
    looked = begin
    while not holds():
        now = time.monotonic()
        if now > begin + timeout:
            assert not required, f"{told} after {timeout} s"
            return False
        ended.wait(float(np.clip(10.0 * (now - looked), 0.02, 0.5)))
        looked = time.monotonic()
    return True


@contextmanager
def launched(launch_file: str, *arguments: str) -> Iterator[None]:
    """Run a launch file of the package: what a test listens to from before the first message to the last one."""
    running = subprocess.Popen(["roslaunch", PACKAGE, launch_file, *arguments], stdin=subprocess.DEVNULL)
    try:
        yield
    finally:
        running.terminate()
        running.wait(timeout=PATIENCE)


def launch(clean_up: Callable[..., Any], launch_file: str, *arguments: str) -> None:
    """Run a launch file of the package until the end of the test, or class, whose `clean_up` is given."""
    running = launched(launch_file, *arguments)
    running.__enter__()
    clean_up(running.__exit__, None, None, None)


def process_of(node: str) -> int:
    """Return the process of a node."""
    return xmlrpc.client.ServerProxy(rosgraph.Master("/graph_test").lookupNode(node)).getPid("/graph_test")[2]


def rows(cloud: Any) -> np.ndarray:
    """Return the points of a float32 PointCloud2 as (n, fields), sorted, so that clouds can be compared."""
    data = np.frombuffer(cloud.data, dtype=np.float32).reshape(-1, len(cloud.fields))
    return data[np.lexsort(data.T[::-1])]


def end_publishing(made: rospy.Publisher) -> None:
    """Unregister a publisher of this process, and wait until those that listened have noticed.

    They would take a new publisher of the topic for the old one, whose connections they have, and not connect again.
    """
    topic = made.resolved_name
    made.unregister()
    told = f"{topic}: still connected"
    wait_until(lambda: not any(_others(node, topic, "i") for node in nodes_of(topic)[1]), told=told)
