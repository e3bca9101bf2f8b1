from dataclasses import replace

import pytest

from imagenex_852_driver.device import DeviceStats
from node_support.health import Level
from sonar_driver.device import DriverHealth


class Line:
    """A device whose stats a test sets, with the health that watches it."""

    def __init__(self):
        self.stats = DeviceStats(connected=True, connections=1)
        self.warnings = []
        self.now = 100.0
        self.health = DriverHealth("driver", self.warnings.append, lambda: self.stats, clock=lambda: self.now)

    def report(self, **changes):
        """Return the report one second later, with the stats changed."""
        self.stats = replace(self.stats, **changes)
        self.now += 1.0
        return self.health.report()


@pytest.fixture
def line():
    return Line()


def test_a_device_that_answers_is_ok_and_shows_all_counts_and_the_rate_of_its_pings(line):
    line.report(pings=10, replies=10, last_error="no reply")
    report = line.report(pings=25)
    assert report.level is Level.OK
    shown = {"pings": "25", "pings per second": "15.00", "bad frames": "0", "last error": "no reply"}
    assert {**report.values, **shown} == report.values


def test_a_device_without_a_port_is_an_error_that_says_why(line):
    report = line.report(connected=False, last_error="port x is lost")
    assert (report.level, report.text) == (Level.ERROR, "not connected: port x is lost")
    assert report.values["connected"] == "false"


@pytest.mark.parametrize(
    ("count", "name"),
    [("timeouts", "timeouts"), ("bad_frames", "bad frames"), ("overruns", "overruns"),
     ("unexpected_replies", "unexpected replies"), ("early_replies", "early replies"),
     ("rejected_switches", "rejected switches")],
)  # fmt: skip
def test_every_problem_warns_and_is_counted(line, count, name):
    report = line.report(**{count: 3})
    assert (report.level, report.values[name]) == (Level.WARN, "3")
    assert f"3 {name}" in line.warnings[0]


def test_a_count_that_stands_still_warns_no_longer(line):
    line.report(timeouts=3)
    line.now += 60.0
    assert line.report().level is Level.OK


@pytest.mark.parametrize(
    ("connected", "connections", "losses"), [(False, 0, 0), (True, 1, 0), (False, 1, 1), (True, 3, 2)]
)
def test_losses_of_the_port_are_counted(line, connected, connections, losses):
    assert line.report(connected=connected, connections=connections).values["losses of the port"] == str(losses)
