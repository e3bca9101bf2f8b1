import time

import pytest
from ping360_line import SETTINGS, connection_to, emulated, running, scanning, served_line
from scanning import PATIENCE

from ping360_driver.emulated_ping360 import EmulatedPing360, EmulatorParameters
from ping360_driver.line.device import Ping360Device
from ping360_driver.protocol.messages import MessageId, packed
from ping360_driver.protocol.scan_command import bin_length
from sonar_driver.emulator.faults import FaultInjector
from sonar_driver.emulator.head_server import HeadServer, PtyLine
from sonar_driver.line.port import PortUnavailableError

SECTOR = SETTINGS.changed({"sector_width_deg": 18.0})
REQUESTS = SETTINGS.changed({"scan_mode": "request"})


def faults(**rates):
    return FaultInjector(EmulatorParameters(**{"silence_duration": 0.5, "absence_duration": 0.3, **rates}))


def test_the_mode_is_told(port):
    with running(port) as (scan, _):
        assert scan.wait_for_more(1)
        assert scan.stats.details()["scan mode"] == "auto_transmit"
        scan.scanner.command = REQUESTS.command()
        assert scan.wait(lambda _: scan.stats.mode == "request")
        # On a busy machine the first request may meet beams that the head still sends by itself, and is lost.
        assert scan.wait_for_more(3)


def test_older_firmware_is_asked_for_every_ping(port):
    with running(port, head=emulated(port, auto_transmit=False)) as (scan, _):
        assert scan.wait_for_more(3)
    assert (scan.stats.mode, scan.stats.firmware, scan.stats.refusals) == ("request", "3.1.1", 0)


def test_changed_settings_reach_the_head(port):
    with running(port) as (scan, _):
        assert scan.wait_for_more(3)
        scan.scanner.command = SECTOR.changed({"max_range": 2.0, "gain_setting": 2}).command()
        assert scan.wait(lambda pings: pings[-1].beam.sector == (190, 210, 1))
    pulse = scan.pings[-1].beam.pulse
    assert pulse.gain_setting == 2
    assert pulse.number_of_samples * bin_length(pulse.sample_period, 1500.0) == pytest.approx(2.0, rel=0.005)


def test_a_pulse_too_long_for_the_head_comes_back_as_the_head_made_it(port):
    settings = SETTINGS.changed({"data_points": 440, "transmit_duration_us": 100})
    command = settings.command()
    too_long = command.__class__(command.pulse.__class__(1, 500, 80, 750, 440))
    with running(port) as (scan, _):
        scan.scanner.command = too_long
        assert scan.wait(lambda pings: bool(pings) and pings[-1].beam.pulse.number_of_samples == 440)
        assert scan.wait_for_more(20)
    assert scan.pings[-1].beam.pulse.transmit_duration == 128
    assert scan.device.stats.details()["transmit duration [us]"] == "128"


@pytest.mark.parametrize("settings", [SETTINGS, REQUESTS], ids=["auto_transmit", "request"])
def test_the_scan_goes_on_after_the_line_was_away(port, settings):
    with running(port, settings) as (scan, server):
        assert scan.wait_for_more(2)
        server.disappear()
        assert scan.wait(lambda _: not scan.stats.connected)
        server.reappear()
        assert scan.wait_for_more(2)
    assert scan.stats.connections == 2


def test_a_head_that_appears_after_the_driver_is_found(port):
    with HeadServer(emulated(port), served_line(port)) as server:
        server.disappear()
        with scanning(connection_to(port)) as scan:
            assert not scan.stats.connected
            server.reappear()
            assert scan.wait_for_more(1)


class Nobody(EmulatedPing360):
    """A line at whose end nobody answers."""

    def receive(self, data, time):
        return []


class EchoSounder(EmulatedPing360):
    """Another device of the same manufacturer."""

    def _answer(self, requested_id, time):
        return self._at_once(packed(MessageId.DEVICE_INFORMATION, device_type=1), time)


@pytest.mark.parametrize(("head", "complaint"), [(Nobody, "no Ping360 answers at"), (EchoSounder, "is no Ping360")])
def test_a_line_without_a_ping360_is_not_connected(tmp_path, head, complaint):
    connection = connection_to(str(tmp_path / "sonar"))
    with HeadServer(head(baud_rate=1152000), PtyLine(connection.port)):
        device = Ping360Device(connection)
        with pytest.raises(PortUnavailableError, match=complaint):
            device.open()
    assert not device.stats.connected


def test_a_stop_ends_the_scan_of_the_head_too(tmp_path):
    port = str(tmp_path / "sonar")
    head = emulated(port)
    with running(port, head=head) as (scan, _):
        assert scan.wait_for_more(2)
        assert scan.stop()
        end = time.monotonic() + PATIENCE
        while head.next_event < float("inf") and time.monotonic() < end:
            time.sleep(0.01)
        assert head.next_event == float("inf")
