import numpy as np
import pytest
from driver_line import scanning, served
from fault_experiment import run
from virtual_line import VirtualLine, VirtualStopAt, VirtualTime

from imagenex_852_driver.emulated_852 import Emulated852, EmulatorParameters
from imagenex_852_driver.line.device import SonarDevice
from imagenex_852_driver.line.parameters import ConnectionParameters, Direction, HeadSettings
from sonar_driver.emulator.faults import Fault, FaultInjector
from sonar_driver.line.device import Scanner
from sonar_driver.line.port import PortRefusedError


def positions(pings):
    return [ping.reply.head_position for ping in pings]


def virtual_scanner(stop, faults, on_ping):
    """Return a scanner with a port in the virtual time of its stop event."""
    connection = ConnectionParameters()
    line = VirtualLine(Emulated852(faults=faults, timing=connection.timing()), connection.baud_rate, stop.time)
    device = SonarDevice(connection, stop, stop.time.elapsed, stop.time.elapsed, line.open)
    scanner = Scanner(device, HeadSettings(max_range=50).command(), on_ping)
    scanner.connect()
    return scanner


def test_pings_are_delivered_one_after_the_other(tmp_path):
    with served(tmp_path) as (_, connection), scanning(connection) as scan:
        assert scan.wait_for_more(5)
    assert positions(scan.pings)[:5] == [1400, 1420, 1440, 1460, 1480]


def test_new_settings_take_effect_at_the_next_ping(tmp_path):
    with served(tmp_path) as (_, connection), scanning(connection) as scan:
        assert scan.wait_for_more(2)
        scan.scanner.command = HeadSettings(max_range=20, direction=Direction.COUNTERCLOCKWISE).command()
        before = len(scan.pings)
        assert scan.wait_for_more(4)
    assert [ping.reply.max_range for ping in scan.pings[before + 1 : before + 3]] == [20, 20]
    assert positions(scan.pings)[before + 2] < positions(scan.pings)[before + 1]


def test_the_scan_goes_on_in_its_sector_after_the_port_was_away(tmp_path):
    sector = HeadSettings(max_range=50, train_angle_deg=0, sector_width_deg=12)
    with served(tmp_path) as (server, connection), scanning(connection, sector) as scan:
        assert scan.wait_for_more(3)
        server.disappear()
        server.reappear()
        assert scan.wait_for_more(12)
    assert set(positions(scan.pings)) == {1360, 1380, 1400, 1420, 1440}
    assert scan.device.stats.connections == 2


def test_the_scan_goes_on_after_the_head_rebooted(tmp_path):
    sector = HeadSettings(max_range=50, train_angle_deg=30, sector_width_deg=6)
    with served(tmp_path) as (server, connection):
        head = server.head = Emulated852(timing=connection.timing())
        with scanning(connection, sector) as scan:
            assert scan.wait_for_more(15)
            before = len(scan.pings)
            head.reboot()
            assert scan.wait_for_more(20)
    assert 1400 in positions(scan.pings[before:])
    assert set(positions(scan.pings[-4:])) == {1580, 1600, 1620}


@pytest.mark.parametrize("absence", [0.3, 7.3, 100.0])
def test_scanning_resumes_within_two_seconds_however_long_the_port_was_away(absence):
    virtual = VirtualTime()
    stop = VirtualStopAt(virtual, absence + 5.0)
    faults, times = FaultInjector(EmulatorParameters(absence_duration=absence)), []
    scanner = virtual_scanner(stop, faults, lambda _: times.append(virtual.now))
    faults.order(Fault.NONE)
    faults.order(Fault.DISAPPEARANCE)
    scanner.run()
    assert absence < max(np.diff(times)) < absence + 2.0


def test_a_port_that_appears_after_the_driver_is_found(tmp_path):
    with served(tmp_path) as (server, connection):
        server.disappear()
        with scanning(connection) as scan:
            assert "cannot be opened" in scan.device.stats.last_error
            server.reappear()
            assert scan.wait_for_more(1)


def test_a_head_that_stays_silent_makes_the_driver_reopen_the_port(tmp_path):
    faults = FaultInjector(EmulatorParameters(silence_duration=0.5))
    with served(tmp_path, reopen_after=0.2) as (server, connection):
        server.head = Emulated852(faults=faults, timing=connection.timing())
        with scanning(connection) as scan:
            assert scan.wait_for_more(1)
            faults.order(Fault.SILENCE)
            assert scan.wait_for_more(3)
    assert scan.device.stats.connections > 1


def test_a_second_scanner_on_the_port_does_not_start(tmp_path):
    with served(tmp_path) as (_, connection), scanning(connection):
        second = Scanner(SonarDevice(connection), HeadSettings().command(), print)
        with pytest.raises(PortRefusedError, match="in use by another program"):
            second.connect()


@pytest.mark.parametrize("gone", [False, True])
def test_a_stop_ends_the_scan(tmp_path, gone):
    with served(tmp_path) as (server, connection), scanning(connection) as scan:
        assert scan.wait_for_more(1)
        if gone:
            server.disappear()
        assert scan.stop()


@pytest.mark.parametrize("fault", [Fault.NONE, Fault.SILENCE, Fault.DISAPPEARANCE])
def test_a_stop_ends_the_scan_at_once(fault):
    stop = VirtualStopAt(VirtualTime(), 5.0)
    faults = FaultInjector(EmulatorParameters(silence_duration=60.0, absence_duration=60.0))
    scanner = virtual_scanner(stop, faults, lambda _: None)
    faults.order(fault)
    scanner.run()
    assert stop.time.now < 5.0 + 0.1


@pytest.fixture(scope="module")
def account():
    """Return what became of 10,000 commands of which a third met a fault."""
    return run(commands=10000, rate=1.0 / 24.0, seed=9)


def test_the_experiment_met_every_fault(account):
    assert set(account.faults) == {Fault.NONE, *EmulatorParameters.known()}


def test_with_every_fault_each_good_reply_is_delivered_once_and_in_order(account):
    assert account.delivered == account.expected


def test_with_every_fault_each_bad_reply_is_counted(account):
    faults, stats = account.faults, account.stats
    assert stats.bad_frames == faults.get(Fault.GARBLED, 0) + faults.get(Fault.TRUNCATED, 0)
    assert stats.unexpected_replies == faults.get(Fault.LATE, 0) + faults.get(Fault.DOUBLED, 0)
    assert stats.pings == stats.replies + stats.timeouts + stats.bad_frames + stats.interrupted
