"""Callbacks that no message can end or silence: of subscribers, also to types that are not installed, and of timers."""

import shutil
import sys
import threading
import time
import traceback
from functools import partial
from pathlib import Path
from typing import Any, Callable, Dict, Iterable

import genpy
import genpy.dynamic
import rospy

from node_support.errors import RefusedInput
from node_support.health import Health

INTERNAL_ERRORS = "internal errors"
_LONGEST_WAIT = 0.1  # s of wall time: the end of the node is noticed within this time


def make_health(name: str) -> Health:
    """Return a Health whose warnings go to the node's log."""
    return Health(name, lambda line: rospy.logwarn("%s", line))


def guarded(health: Health, callback: Callable[..., None], topic: str = "") -> Callable[..., None]:
    """Wrap a callback so that no message can end or silence the node: refusals and failures are counted and logged.

    topic: from which messages are needed all the time; `health` says when they cease.
    """

    def call(*arguments: Any) -> None:
        if topic:
            health.heard(rospy.resolve_name(topic))
        try:
            callback(*arguments)
        except RefusedInput as refused:
            health.problem(refused.kind, str(refused))
        except rospy.ROSInterruptException:
            pass
        except Exception as error:
            if rospy.core.is_shutdown_requested():
                return
            health.problem(INTERNAL_ERRORS, f"{type(error).__name__}: {error}; please report this")
            rospy.logerr_throttle(10.0, traceback.format_exc())

    return call


def every(period: float, callback: Callable[[], None], health: Health) -> None:
    """Call back every `period` seconds of wall time until shutdown.

    Wall time, because diagnostics and displays must go on while a simulated clock stands still or jumps.
    """
    call = guarded(health, callback)

    def loop() -> None:
        next_call = time.monotonic()
        while not rospy.core.is_shutdown_requested():
            next_call = max(next_call + period, time.monotonic())
            while not rospy.core.is_shutdown_requested() and time.monotonic() < next_call:
                time.sleep(min(_LONGEST_WAIT, max(next_call - time.monotonic(), 0.0)))
            call()

    threading.Thread(target=loop, daemon=True).start()


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
                _wait_on_clock(due - now)
                continue
            due = due + period if 0.0 <= now - due < period else now + period
            call()

    thread = threading.Thread(target=loop, daemon=True)
    thread.start()
    return thread


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


def _wait_on_clock(seconds: float) -> None:
    """Wait until ROS time may have advanced by `seconds`."""
    if rospy.rostime.is_wallclock():
        time.sleep(min(seconds, _LONGEST_WAIT))
    else:
        news = rospy.rostime.get_rostime_cond()
        with news:
            news.wait(_LONGEST_WAIT)


_KIND = "messages not readable"


class MessageClasses:
    """Makes and keeps one class for each type and definition."""

    def __init__(self, built: Iterable[type] = ()) -> None:
        """`built`: classes that are there already and need not be made."""
        self._classes: Dict[str, type] = {kind._md5sum: kind for kind in built}

    def deserialised(self, message: rospy.AnyMsg) -> genpy.Message:
        """Return the message; raises RefusedInput when definition and bytes do not make one."""
        header = message._connection_header
        md5sum = header["md5sum"]
        if md5sum not in self._classes:
            self._classes[md5sum] = _generated(header["type"], header.get("message_definition", ""))
        try:
            return self._classes[md5sum]().deserialize(message._buff)
        except (genpy.DeserializationError, ValueError, MemoryError) as error:
            raise RefusedInput(_KIND, f"{header['type']}: {error}") from error


def _generated(name: str, definition: str) -> type:
    try:
        made = genpy.dynamic.generate_dynamic(name, definition)[name]
    except Exception as error:  # Whatever the parser, the generator or the generated code stumbles over
        raise RefusedInput(_KIND, f"{name}: no usable definition: {error}") from error
    # genpy imports the class from a folder of its own, which it removes at an exit that our nodes do not take.
    folder = Path(sys.modules[made.__module__].__file__).parent
    rospy.on_shutdown(partial(shutil.rmtree, folder, ignore_errors=True))
    return made
