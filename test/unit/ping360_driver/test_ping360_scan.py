"""The Ping360 scans by itself or is asked for every ping; who is at the other end of its line."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from emulated_drivers import EPOCH, PING360, PING360_REQUESTS, VirtualScan, running, served, wait_until

from ping360_driver.device import Ping360Device
from ping360_driver.emulated_ping360 import EmulatedPing360, EmulatorParameters
from ping360_driver.messages import MessageId, packed
from ping360_driver.scan_command import PulseSettings, ScanCommand, bin_length
from sonar_driver.emulated_head import Fault, FaultInjector
from sonar_driver.port import PortUnavailableError

MODES = pytest.mark.parametrize(
    "settings", [PING360.settings, PING360_REQUESTS.settings], ids=["auto_transmit", "request"]
)


@pytest.fixture(params=["virtual", "udp://virtual:1"], ids=["serial", "udp"])
def port(request):
    return request.param


@MODES
@pytest.mark.parametrize(
    ("sector", "angles", "by_itself"),
    [
        ({}, [*range(400), *range(5)], True),
        ({"sector_width_deg": 18.0}, [*range(190, 211), *range(209, 200, -1)], True),
        # Across astern it is asked ping by ping.
        ({"sector_width_deg": 18.0, "train_angle_deg": 180.0}, [*range(390, 400), *range(5)], False),
    ],
)
def test_a_full_turn_is_scanned_round_and_round_and_a_sector_to_and_fro(port, settings, sector, angles, by_itself):
    scan = VirtualScan(PING360, port, settings.changed(sector))
    scan.beams(len(angles))
    assert [ping.beam.angle for ping in scan.pings] == angles
    assert scan.numbers == list(range(len(angles)))
    assert scan.stats.mode == (settings.scan_mode.value if by_itself else "request")


class CannotScan(EmulatedPing360):
    """A head that says that its firmware is new, and does not scan by itself all the same."""

    def _complaint(self, message):
        return "not today" if message.message_id == MessageId.AUTO_TRANSMIT else ""


def test_a_head_that_refuses_to_scan_by_itself_is_asked_for_every_ping():
    scan = VirtualScan(PING360, head=CannotScan)
    scan.beams(3)
    assert (scan.stats.mode, scan.stats.refusals) == ("request", 1)
    assert "message 2602: not today" in scan.stats.last_error


def test_older_firmware_is_asked_for_every_ping(port):
    scan = VirtualScan(PING360, port, told={"auto_transmit": False})
    scan.beams(3)
    assert (scan.stats.mode, scan.stats.firmware, scan.stats.refusals) == ("request", "3.1.1", 0)


def test_the_mode_can_change_while_the_head_scans(port):
    scan = VirtualScan(PING360, port)
    scan.beams(1)
    assert scan.stats.details()["scan mode"] == "auto_transmit"
    scan.settings = PING360_REQUESTS.settings
    scan.until(lambda: scan.stats.mode == "request")
    scan.beams(3)


def test_changed_settings_reach_the_head(port):
    scan = VirtualScan(PING360, port)
    scan.beams(3)
    scan.settings = PING360.settings.changed({"sector_width_deg": 18.0, "max_range": 2.0, "gain_setting": 2})
    scan.until(lambda: scan.pings[-1].beam.sector == (190, 210, 1))
    pulse = scan.pings[-1].beam.pulse
    assert pulse.gain_setting == 2
    assert pulse.number_of_samples * bin_length(pulse.sample_period, 1500.0) == pytest.approx(2.0, rel=0.005)


def test_a_pulse_too_long_for_the_head_comes_back_as_the_head_made_it(port):
    scan = VirtualScan(PING360, port)
    too_long = ScanCommand(PulseSettings(1, 500, 80, 750, 440))
    scan.settings = SimpleNamespace(command=lambda: too_long)
    scan.beams(20)
    assert scan.pings[-1].beam.pulse.transmit_duration == 128
    assert scan.stats.details()["transmit duration [us]"] == "128"


@MODES
@pytest.mark.parametrize("max_range", [1.0, 20.0])
def test_stamps_are_when_the_pings_left(port, settings, max_range):
    scan = VirtualScan(PING360, port, settings.changed({"max_range": max_range}), baud_rate=115200)
    scan.beams(20)
    assert [ping.stamp for ping in scan.pings] == pytest.approx(EPOCH + np.array(scan.echoes.times[:20]), abs=1e-4)


def test_beams_that_came_while_the_driver_was_starved_of_time_are_stamped_one_after_the_other(port):
    scan = VirtualScan(PING360, port)
    starved = 0.0213
    for _ in range(10):
        scan.beams(3)
        scan.time.now += starved
    scan.beams(10)
    times = EPOCH + np.array(scan.echoes.times[: len(scan.pings)])
    assert np.all(np.diff([ping.stamp for ping in scan.pings]) > 0.0)
    assert np.all(np.abs([ping.stamp for ping in scan.pings] - times) <= starved)


class InterruptedScan(VirtualScan):
    """A scan whose driver is interrupted before every other time at which it reads the clock of stamps."""

    readings = 0

    def clock(self):
        self.readings += 1
        self.time.now += 0.003 * (self.readings % 2)
        return super().clock()


def test_a_driver_that_is_interrupted_while_it_reads_its_clocks_stamps_its_beams_right(port):
    scan = InterruptedScan(PING360, port)
    scan.beams(20)
    assert scan.readings == 40
    assert [ping.stamp for ping in scan.pings] == pytest.approx(EPOCH + np.array(scan.echoes.times[:20]), abs=1e-4)


def test_a_late_reply_is_not_taken_for_the_answer_to_the_next_request(port):
    faults = FaultInjector(EmulatorParameters(lateness=0.4))
    scan = VirtualScan(PING360_REQUESTS, port, faults=faults)
    scan.beams(2)
    faults.order(Fault.LATE)
    scan.until(lambda: scan.stats.unexpected_replies == 1)
    scan.beams(2)
    assert all(ping.beam.angle == number for ping, number in zip(scan.pings, scan.numbers))


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
    with served(PING360, tmp_path / "sonar", head(EmulatorParameters(baud_rate=1152000))) as (_, connection):
        device = Ping360Device(connection)
        with pytest.raises(PortUnavailableError, match=complaint):
            device.open()
    assert not device.stats.connected


def test_a_stop_ends_the_scan_of_the_head_too(tmp_path):
    sector = PING360.settings.changed({"sector_width_deg": 18.0})
    with running(PING360, tmp_path / "sonar", sector) as (scan, server):
        assert scan.wait_for_more(2)
        assert scan.stop()
        assert wait_until(lambda: server.head.next_event == math.inf)
