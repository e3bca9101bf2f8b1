"""Calls that follow changes."""

import queue
import time
from types import SimpleNamespace

import pytest
import rospy

from node_support.health import Health
from node_support.ros import callbacks
from node_support.ros.callbacks import on_change

PATIENCE = 60.0
LONG, SHORT = 3600.0, 0.2


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


def test_answers_are_a_period_apart(start):
    tell, made = start(SHORT)
    tell()
    first = made.get(timeout=PATIENCE)
    tell()
    assert made.get(timeout=PATIENCE) - first >= SHORT


def test_several_changes_within_a_period_have_one_answer(start):
    tell, made = start(SHORT)
    tell()
    made.get(timeout=PATIENCE)
    for _ in range(5):
        tell()
    second, third = made.get(timeout=PATIENCE), made.get(timeout=PATIENCE)
    assert third - second >= SHORT


def test_without_a_change_every_period_brings_a_call(start):
    _, made = start(SHORT)
    first, second = made.get(timeout=PATIENCE), made.get(timeout=PATIENCE)
    assert second - first >= SHORT
