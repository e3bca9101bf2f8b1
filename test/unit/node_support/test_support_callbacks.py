"""Callbacks that no message can end or silence, that follow a simulated clock, and that follow changes."""

import queue
import time
from types import SimpleNamespace

import genpy
import pytest
import rospy

from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.ros import callbacks
from node_support.ros.callbacks import every_clock_period, guarded, on_change

PATIENCE = 60.0
PERIOD = 0.5
LONG, SHORT = 3600.0, 0.2


@pytest.fixture
def warnings(monkeypatch):
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: False)
    monkeypatch.setattr(rospy, "logerr_throttle", lambda period, text: None)
    return []


def _called(warnings, failure):
    health = Health("stage", warnings.append)

    def callback(argument):
        raise failure

    guarded(health, callback)("message")
    return health.report()


def test_arguments_are_handed_on():
    taken = []
    guarded(Health("stage", taken.append), lambda *arguments: taken.append(arguments))(1, "two")
    assert taken == [(1, "two")]


@pytest.mark.parametrize(
    ("failure", "kind", "detail"),
    [
        (RefusedInput("beams refused", "0 bins"), "beams refused", "0 bins"),
        (KeyError("range"), "internal errors", "KeyError: 'range'; please report this"),
    ],
)
def test_refused_input_is_counted_under_its_kind_and_an_exception_as_an_internal_error(warnings, failure, kind, detail):
    assert _called(warnings, failure).values == {kind: "1"}
    assert warnings == [f"stage: 1 {kind} (1 in all): {detail}"]


def test_the_interruption_of_a_sleep_and_an_exception_during_shutdown_are_nobodys_fault(warnings, monkeypatch):
    assert _called(warnings, rospy.ROSInterruptException()).values == {}
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: True)
    assert _called(warnings, OSError("closed")).values == {}


@pytest.fixture
def calls(monkeypatch):
    """Start a timer at 100 s of simulated time; yield the queue of the times at which it called."""
    ended = []
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: bool(ended))
    rospy.rostime.set_rostime_initialized(True)
    _set(100.0)
    made = queue.Queue()
    thread = every_clock_period(PERIOD, lambda: made.put(rospy.get_time()), Health("stage", print))
    assert made.get(timeout=PATIENCE) == 100.0
    yield made
    ended.append(True)
    thread.join()
    rospy.rostime.switch_to_wallclock()
    rospy.rostime.set_rostime_initialized(False)


def _set(seconds):
    rospy.rostime._set_rostime(genpy.Time.from_sec(seconds))


def test_a_clock_that_goes_on_brings_a_call_for_each_period(calls):
    for seconds in (100.5, 101.0, 101.5):
        _set(seconds)
        assert calls.get(timeout=PATIENCE) == seconds


def test_a_clock_that_stands_brings_none(calls):
    _set(100.4)
    with pytest.raises(queue.Empty):
        calls.get(timeout=0.3)


@pytest.mark.parametrize("moment", [0.0, 1.0, 99.0, 2.0**31, 2.0**32 - 1.0])
def test_a_clock_that_jumps_brings_a_call_there_and_after_its_return(calls, moment):
    for seconds in (moment, 100.0, moment, 100.0):
        _set(seconds)
        assert calls.get(timeout=PATIENCE) == seconds


@pytest.fixture
def start(monkeypatch):
    """Return a function that starts waiting for changes; it returns what tells of one and the queue of call times."""
    ended, read = [], []

    def monotonic():
        read.append(time.monotonic())
        return read[-1]

    # A call may come late after the moment that the periods are counted from.
    monkeypatch.setattr(callbacks, "time", SimpleNamespace(monotonic=monotonic, sleep=time.sleep))
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: bool(ended))

    def begin(period):
        made = queue.Queue()
        tell = on_change(period, lambda: made.put(read[-1]), Health("stage", print))
        made.get(timeout=PATIENCE)  # Nothing was called yet, so that the first call is due
        return tell, made

    yield begin
    ended.append(True)


def test_a_change_is_answered_long_before_the_period_ends(start):
    tell, made = start(LONG)
    tell()
    made.get(timeout=PATIENCE)


def test_answers_are_a_period_apart_and_several_changes_within_one_have_one_answer(start):
    tell, made = start(SHORT)
    tell()
    first = made.get(timeout=PATIENCE)
    for _ in range(5):
        tell()
    second, third = made.get(timeout=PATIENCE), made.get(timeout=PATIENCE)
    assert second - first >= SHORT
    assert third - second >= SHORT


def test_without_a_change_every_period_brings_a_call(start):
    _, made = start(SHORT)
    first, second = made.get(timeout=PATIENCE), made.get(timeout=PATIENCE)
    assert second - first >= SHORT
