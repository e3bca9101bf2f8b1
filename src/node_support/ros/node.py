"""How all nodes start, guard their callbacks and publish diagnostics."""

import sys
import threading
import time
import traceback
from typing import Any, Callable, Protocol, Sequence

import rospy
from diagnostic_updater import DiagnosticStatusWrapper, Updater

from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.parameters import ParameterError

DIAGNOSTICS_PERIOD = 1.0  # s: as often as diagnostic aggregators expect it
_SPIN_STEP = 0.05  # s: soon enough to end a node at once, seldom enough to cost nothing


class StartError(Exception):
    """The node cannot start until the user changes something; the text says what, in one line."""


class Node(Protocol):
    """What `run` runs."""

    healths: Sequence[Health]
    """Of all stages that the node hosts, for /diagnostics."""


def run(name: str, make_node: Callable[[], Node]) -> None:
    """Initialise the node, make it, publish its diagnostics and spin until Ctrl-C.

    ParameterError and StartError end it with one line and status 1.
    """
    rospy.init_node(name)
    try:
        node = make_node()
        publish_diagnostics(node.healths)
    except (ParameterError, StartError) as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        sys.exit(1)
    except rospy.ROSInterruptException:
        return
    _spin()
    del node


def _spin() -> None:
    """Wait for the end; rospy.spin notices it up to half a second late, and roslaunch ends nodes one by one.

    No threading.Event: the handler of Ctrl-C runs in this thread too, and would wait for ever for the Event's lock when
    it comes while this thread holds it.
    """
    while not rospy.is_shutdown():
        time.sleep(_SPIN_STEP)


def make_health(name: str) -> Health:
    """Return a Health whose warnings go to the node's log."""
    return Health(name, lambda line: rospy.logwarn("%s", line))


def guarded(health: Health, callback: Callable[..., None]) -> Callable[..., None]:
    """Wrap a callback so that no message can end or silence the node: refusals and failures are counted and logged."""

    def call(*arguments: Any) -> None:
        try:
            callback(*arguments)
        except RefusedInput as refused:
            health.problem(refused.kind, str(refused))
        except rospy.ROSInterruptException:
            pass
        except Exception as error:
            if rospy.core.is_shutdown_requested():
                return
            health.problem("internal errors", f"{type(error).__name__}: {error}; please report this")
            rospy.logerr_throttle(10.0, traceback.format_exc())

    return call


def every(period: float, callback: Callable[[], None], health: Health) -> threading.Thread:
    """Call back every `period` seconds of wall time until shutdown.

    Wall time, because diagnostics and displays must go on while a simulated clock stands still or jumps.
    """
    call = guarded(health, callback)

    def loop() -> None:
        next_call = time.monotonic()
        while not rospy.core.is_shutdown_requested():
            next_call = max(next_call + period, time.monotonic())
            while not rospy.core.is_shutdown_requested() and time.monotonic() < next_call:
                time.sleep(min(0.1, max(next_call - time.monotonic(), 0.0)))
            call()

    thread = threading.Thread(target=loop, daemon=True)
    thread.start()
    return thread


def publish_diagnostics(healths: Sequence[Health]) -> None:
    """Publish what a process's stages report on /diagnostics once a second, each as "node: stage"."""
    updater = Updater()
    updater.setHardwareID("none")
    for health in healths:
        updater.add(health.name, _filler(health))
    every(DIAGNOSTICS_PERIOD, updater.force_update, healths[0])


def _filler(health: Health) -> Callable[[DiagnosticStatusWrapper], DiagnosticStatusWrapper]:
    def fill(status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        report = health.report()
        status.summary(int(report.level), report.text)
        for key, value in report.values.items():
            status.add(key, value)
        return status

    return fill
