"""What the driver of every sonar does with its head: over faults, losses of the line and stops."""

import re
from dataclasses import replace

import numpy as np
import pytest
from emulated_drivers import (
    IMAGENEX_852,
    PING360,
    PING360_REQUESTS,
    SONARS,
    Scanning,
    VirtualScan,
    free_udp_port,
    running,
    served,
    wait_until,
)
from fault_experiment import run
from virtual_line import VirtualTime

from sonar_driver.emulated_head import Fault, FaultInjector
from sonar_driver.port import PortRefusedError

BOTH_PORTS = [
    *((sonar, "serial") for sonar in SONARS.values()),
    *((sonar, "udp") for sonar in (PING360, PING360_REQUESTS)),
]
NAMES = [*SONARS, "ping360_udp", "ping360_requests_udp"]


@pytest.fixture(params=BOTH_PORTS, ids=NAMES)
def ends(request, tmp_path):
    """Return a sonar whose head need not turn far before its first ping, and a port of this computer."""
    sonar, kind = request.param
    sonar = replace(sonar, settings=sonar.settings.changed({"sector_width_deg": 18}))
    return sonar, str(tmp_path / "sonar") if kind == "serial" else free_udp_port()


@pytest.fixture(params=BOTH_PORTS, ids=NAMES)
def virtual(request):
    """Return a sonar, and a port in virtual time."""
    sonar, kind = request.param
    return sonar, "virtual" if kind == "serial" else "udp://virtual:1"


def test_the_scan_goes_on_after_the_line_was_away(ends):
    with running(*ends) as (scan, server):
        assert scan.wait_for_more(2)
        server.disappear()
        assert wait_until(lambda: not scan.stats.connected)
        server.reappear()
        assert scan.wait_for_more(2)
    assert scan.stats.connections == 2


def test_a_head_that_appears_after_the_driver_is_found(ends):
    with served(*ends) as (server, connection):
        server.disappear()
        with Scanning(ends[0], connection) as scan:
            assert not scan.stats.connected
            server.reappear()
            assert scan.wait_for_more(1)


@pytest.mark.parametrize("gone", [False, True])
def test_a_stop_ends_the_scan(ends, gone):
    with running(*ends) as (scan, server):
        assert scan.wait_for_more(1)
        if gone:
            server.disappear()
        assert scan.stop()


def test_a_second_driver_on_the_port_does_not_start(tmp_path):
    with running(IMAGENEX_852, tmp_path / "sonar") as (scan, _):
        second = IMAGENEX_852.device(scan.device.connection)
        with pytest.raises(PortRefusedError, match="in use by another program"):
            second.open()


# As what each fault is counted.
COUNTED = {
    Fault.GARBLED: "bad_frames",
    Fault.TRUNCATED: "bad_frames",
    Fault.DOUBLED: "unexpected_replies",
    Fault.REFUSED: "refusals",
    Fault.OVERRUN: "overruns",
    Fault.DROPPED: "timeouts",
    Fault.LATE: "unexpected_replies",
}
# A driver that has nothing to ask notes a gap, and takes what is late.
WITHOUT_REQUESTS = {**COUNTED, Fault.DROPPED: "missing_beams", Fault.LATE: "replies"}
# What is told with a count.
TOLD = {
    "bad_frames": "bad reply|a broken message",
    "unexpected_replies": "a reply came (late or )?twice|no beam in time",
    "refusals": "the head refused message",
    "overruns": "the head lost characters",
    "timeouts": "no reply within|no beam in time",
}


@pytest.mark.parametrize("fault", COUNTED)
def test_each_fault_is_counted_and_every_good_beam_delivered_once(virtual, fault):
    sonar, port = virtual
    if fault not in sonar.rates.known():
        return
    faults = FaultInjector(sonar.rates(lateness=0.2))
    scan = VirtualScan(sonar, port, faults=faults)
    scan.beams(2)
    faults.order(fault)
    count = (WITHOUT_REQUESTS if sonar is PING360 else COUNTED)[fault]
    before = getattr(scan.stats, count)
    scan.until(lambda: getattr(scan.stats, count) == before + 1)
    assert re.search(TOLD.get(count, ""), scan.stats.last_error)
    scan.beams(3)
    lost = set() if fault in (*sonar.good, Fault.REFUSED) else {2}
    assert scan.numbers == [one for one in range(scan.numbers[-1] + 1) if one not in lost]
    assert scan.stats.timeouts == (sonar is not PING360 and fault in (Fault.DROPPED, Fault.LATE))


@pytest.mark.parametrize("fault", [Fault.SILENCE, Fault.DISAPPEARANCE])
@pytest.mark.parametrize("absence", [0.3, 7.3, 100.0])
def test_the_scan_goes_on_within_two_seconds_after_the_head_was_away(virtual, fault, absence):
    sonar, port = virtual
    faults = FaultInjector(sonar.rates(silence_duration=absence, absence_duration=absence))
    scan = VirtualScan(sonar, port, faults=faults, time=VirtualTime(absence + 5.0))
    faults.order(Fault.NONE)
    faults.order(fault)
    scan.scan()
    gaps = np.diff([ping.stamp for ping in scan.pings])
    assert absence < max(gaps) < absence + 2.0


def test_a_head_that_stays_silent_makes_the_driver_reopen_the_port(virtual):
    sonar, port = virtual
    faults = FaultInjector(sonar.rates(silence_duration=3.0))
    scan = VirtualScan(sonar, port, faults=faults, time=VirtualTime(10.0), reopen_after=0.2)
    faults.order(Fault.SILENCE)
    scan.scan()
    assert scan.stats.connections > 1
    assert scan.pings


@pytest.mark.parametrize("fault", [Fault.NONE, Fault.SILENCE, Fault.DISAPPEARANCE])
def test_a_stop_ends_the_scan_at_once(virtual, fault):
    sonar, port = virtual
    faults = FaultInjector(sonar.rates(silence_duration=60.0, absence_duration=60.0))
    scan = VirtualScan(sonar, port, faults=faults, time=VirtualTime(3.0))
    faults.order(fault)
    scan.scan()
    assert scan.time.now < 3.0 + 0.2


@pytest.fixture(scope="module", params=SONARS.values(), ids=SONARS)
def experiment(request):
    """Return a sonar, and what became of 3,000 replies of which a third met a fault."""
    return request.param, run(request.param, 3000, seed=3)


class TestExperiment:
    def test_it_met_every_fault(self, experiment):
        sonar, account = experiment
        assert set(account.faults) == {Fault.NONE, *sonar.rates.known()}

    def test_each_good_reply_is_delivered_once_and_in_order(self, experiment):
        account = experiment[1]
        assert account.delivered == sorted(set(account.delivered))
        assert account.taken == account.expected

    def test_each_bad_reply_is_counted_and_every_ping_ends_in_exactly_one_count(self, experiment):
        """While a head scans by itself, a few pieces of broken messages in a row look like one message."""
        sonar, (faults, stats) = experiment[0], (experiment[1].faults, experiment[1].stats)
        spoilt = faults[Fault.GARBLED] + faults[Fault.TRUNCATED]
        assert spoilt >= stats.bad_frames >= (0.98 * spoilt if sonar is PING360 else spoilt)
        if sonar is IMAGENEX_852:
            assert stats.unexpected_replies == faults[Fault.LATE] + faults[Fault.DOUBLED]
        else:
            assert stats.unexpected_replies >= faults[Fault.DOUBLED]
            assert stats.refusals == faults[Fault.REFUSED]
        refusals = getattr(stats, "refusals", 0)
        ended = stats.replies + stats.timeouts + stats.bad_frames + refusals + stats.interrupted
        assert stats.pings == ended
