"""Calls that follow a simulated clock."""

import queue

import genpy
import pytest
import rospy

from node_support.health import Health
from node_support.ros.callbacks import every_clock_period

PATIENCE = 60.0
PERIOD = 0.5


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
