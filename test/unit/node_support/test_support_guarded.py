"""Callbacks that no message can end or silence."""

import pytest
import rospy

from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.ros.callbacks import guarded


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


def test_refused_input_is_counted_under_its_kind(warnings):
    report = _called(warnings, RefusedInput("beams refused", "0 bins"))
    assert report.values == {"beams refused": "1"}
    assert warnings == ["stage: 1 beams refused (1 in all): 0 bins"]


def test_an_exception_is_counted_as_an_internal_error_and_named(warnings):
    report = _called(warnings, KeyError("range"))
    assert report.values == {"internal errors": "1"}
    assert warnings == ["stage: 1 internal errors (1 in all): KeyError: 'range'; please report this"]


def test_an_exception_during_shutdown_is_nobodys_fault(warnings, monkeypatch):
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: True)
    assert _called(warnings, OSError("closed")).values == {}


def test_the_interruption_of_a_sleep_is_nobodys_fault(warnings):
    assert _called(warnings, rospy.ROSInterruptException()).values == {}
