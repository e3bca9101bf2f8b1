"""How all nodes start, publish diagnostics, hold little memory, and end: by Ctrl-C or when a new master lacks them."""

import atexit
import ctypes
import os
import signal
import sys
import threading
import time
import xmlrpc.client
from contextlib import suppress
from functools import partial
from typing import Any, Callable, NoReturn, Optional, Sequence

import rosgraph
import rospy
from diagnostic_updater import DiagnosticStatusWrapper, Updater

from node_support.health import Health
from node_support.parameters import ParameterError
from node_support.ros.callbacks import every

DIAGNOSTICS_PERIOD = 1.0  # s: as often as diagnostic aggregators expect it
MEMORY_PERIOD = 10.0  # s: giving memory back takes some milliseconds
MASTER_PERIOD = 2.0  # s: soon enough for a respawn, seldom enough to cost nothing
_ENOUGH = 2  # answers of the master in a row: the first one may come while the node itself registers
_SUCCESS = 1  # status of the XML-RPC interface of ROS; others mean that the node is unknown
_SPIN_STEP = 0.05  # s: soon enough to end a node at once, seldom enough to cost nothing
_UNKNOWN_TO_MASTER = (
    "the ROS master was restarted and does not know this node, so that nobody can connect to it; the node ends. "
    "Parameters were lost with the old master: restart the launch file"
)
# s from the last message to the end of a node that plays a recording: when a connection ends, rospy drops what a
# listener that stood still for a while has not yet read.
LAST_MESSAGES_ARRIVE = 3.0
_END_STEP = 0.01  # s: roslaunch waits for every node
_LONGEST_END = 10.0  # s: a map may have to be saved; roslaunch kills a node after 15 s
_PATIENCE = 5.0  # s: a master that was killed while it was connected may never answer


class StartError(Exception):
    """The node cannot start until the user changes something; the text says what, in one line."""


def run(
    name: str, make_node: Callable[[], Any], healths_of: Callable[[Any], Sequence[Health]] = lambda one: [one.health]
) -> NoReturn:
    """Initialise the node, make it, publish its diagnostics, wait for Ctrl-C and end the process.

    ParameterError, StartError and the loss of its registration at the master end it with one line and status 1.
    healths_of: returns the health of all stages that the node hosts, for /diagnostics.
    """
    interrupt = _Interrupt()
    hold_little()
    try:
        status = _run(name, make_node, healths_of, interrupt)
    except (KeyboardInterrupt, rospy.ROSInterruptException):
        status = 0
    _end(status)


def _run(
    name: str, make_node: Callable[[], Any], healths_of: Callable[[Any], Sequence[Health]], interrupt: "_Interrupt"
) -> int:
    rospy.init_node(name, disable_signals=True)
    try:
        node = make_node()
        healths = healths_of(node)
        publish_diagnostics(healths)
        every(MEMORY_PERIOD, give_back, healths[0])
    except (ParameterError, StartError) as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    watch = MasterWatch()
    while not rospy.is_shutdown() and not interrupt.came:
        if watch.is_lost:
            rospy.logfatal("%s: %s", rospy.get_name(), _UNKNOWN_TO_MASTER)
            return 1
        time.sleep(_SPIN_STEP)
    return 0


class _Interrupt:
    """Takes Ctrl-C and SIGTERM in rospy's place.

    rospy unregisters the node inside the signal handler. When the signal comes while the main thread itself talks to
    the master, as it does while the node starts, the handler waits for ever for the lock that this very thread holds.
    """

    def __init__(self) -> None:
        self.came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._take)

    def _take(self, *_: Any) -> None:
        self.came = True
        raise KeyboardInterrupt


def _end(status: int) -> NoReturn:
    """Unregister, run what waits for the shutdown, and end the process with `status`.

    The process ends at once then: rospy's threads would take another half second to notice the shutdown. What libraries
    do at the end of a process is done before, so that genpy removes its temporary folder.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_shut_down, daemon=True).start()
    deadline = time.monotonic() + _LONGEST_END
    while not rospy.is_shutdown() and time.monotonic() < deadline:
        time.sleep(_END_STEP)
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def _shut_down() -> None:
    # An interrupted call leaves its connection unusable for one more call, which must not be the one that unregisters.
    with suppress(Exception):
        rospy.get_master().getPid()
    rospy.signal_shutdown("the node ends")


def publish_diagnostics(healths: Sequence[Health]) -> None:
    """Publish what a process's stages report on /diagnostics once a second, each as "node: stage"."""
    updater = Updater()
    updater.setHardwareID("none")
    for health in healths:
        updater.add(health.name, partial(_fill, health))
    every(DIAGNOSTICS_PERIOD, updater.force_update, healths[0])


def _fill(health: Health, status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
    report = health.report()
    status.summary(int(report.level), report.text)
    for key, value in report.values.items():
        status.add(key, value)
    return status


class _ImpatientTransport(xmlrpc.client.Transport):
    """Waits for no answer for ever."""

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = _PATIENCE
        return connection


class MasterWatch:
    """Asks the master every `MASTER_PERIOD` seconds whether it knows this node.

    A master that gives no answer may only be away for a while, and the node runs on. A new master, which answers that
    it does not know the node, has neither its topics nor its parameters: nobody will ever connect to the node again.
    It may know the node's name all the same, for rospy asks it for a parameter with each log line: then its process
    number tells.
    """

    def __init__(self) -> None:
        """Begin to watch; the node has to be initialised."""
        self.is_lost = False
        self._master = xmlrpc.client.ServerProxy(rosgraph.get_master_uri(), _ImpatientTransport())
        # Asked at once: one that is restarted within the first period would be taken for the one that was there.
        self._process = self._asked_process()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        unknown = 0
        while unknown < _ENOUGH:
            time.sleep(MASTER_PERIOD)
            unknown = unknown + 1 if self._does_not_know_us() else 0
        self.is_lost = True

    def _asked_process(self) -> Optional[int]:
        try:
            return self._master.getPid(rospy.get_name())[2]
        except Exception:
            # A master that is killed while it answers leaves half an answer, and that almost any error.
            return None

    def _does_not_know_us(self) -> bool:
        process = self._asked_process()
        try:
            status, _, uri = self._master.lookupNode(rospy.get_name(), rospy.get_name())
        except Exception:
            return False
        if process is None:
            return False
        self._process = self._process or process
        return status != _SUCCESS or uri != rospy.get_node_uri() or process != self._process


# Of mallopt in glibc's malloc.h.
_MMAP_THRESHOLD, _ARENA_MAX = -3, -8
_LARGE = 2**17  # bytes: as glibc begins with, but it raises that to the largest array that was ever freed
_ARENAS = 2


def hold_little() -> None:
    """Give large arrays memory of their own, which goes back when they do, and let threads share what is left.

    A node makes arrays of all sizes for hours and keeps a few. glibc would hold several times what it uses: a heap for
    each thread, with holes where large arrays were.
    """
    set_option = getattr(ctypes.CDLL(None), "mallopt", None)
    if set_option is not None:
        set_option(_MMAP_THRESHOLD, _LARGE)
        set_option(_ARENA_MAX, _ARENAS)


def give_back() -> None:
    """Give what was freed back to the system, also between what is still used."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
