from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from ping360_line import SETTINGS
from virtual_line import VirtualStopAt, VirtualTime
from virtual_scan import VirtualScan

from ping360_driver.emulated_ping360 import EmulatedPing360, EmulatorParameters
from ping360_driver.protocol.messages import MessageId
from ping360_driver.protocol.scan_command import PulseSettings, ScanCommand, bin_length
from sonar_driver.emulator.faults import Fault, FaultInjector

REQUESTS = SETTINGS.changed({"scan_mode": "request"})
MODES = pytest.mark.parametrize("settings", [SETTINGS, REQUESTS], ids=["auto_transmit", "request"])


@pytest.fixture(params=["virtual", "udp://virtual:1"], ids=["serial", "udp"])
def port(request):
    return request.param


@pytest.fixture
def injector():
    return FaultInjector(EmulatorParameters(lateness=0.4))


@MODES
def test_beams_of_a_full_turn_come_one_after_the_other(port, settings):
    scan = VirtualScan(port, settings)
    scan.beams(405)
    assert scan.angles == [*range(400), *range(5)]
    assert scan.numbers == list(range(405))


@MODES
def test_a_sector_is_scanned_to_and_fro(port, settings):
    scan = VirtualScan(port, settings.changed({"sector_width_deg": 18.0}))
    scan.beams(30)
    assert scan.angles == [*range(190, 211), *range(209, 200, -1)]


class CannotScan(EmulatedPing360):
    """A head that says that its firmware is new, and does not scan by itself all the same."""

    def _complaint(self, message):
        return "not today" if message.message_id == MessageId.AUTO_TRANSMIT else ""


def test_a_head_that_refuses_to_scan_by_itself_is_asked_for_every_ping():
    scan = VirtualScan(head=CannotScan)
    scan.beams(3)
    assert (scan.stats.mode, scan.stats.refusals) == ("request", 1)
    assert "message 2602: not today" in scan.stats.last_error


def test_older_firmware_is_asked_for_every_ping(port):
    scan = VirtualScan(port, head=partial(EmulatedPing360, auto_transmit=False))
    scan.beams(3)
    assert (scan.stats.mode, scan.stats.firmware, scan.stats.refusals) == ("request", "3.1.1", 0)


def test_the_mode_can_change_while_the_head_scans(port):
    scan = VirtualScan(port)
    scan.beams(1)
    assert scan.stats.details()["scan mode"] == "auto_transmit"
    scan.settings = REQUESTS
    scan.until(lambda: scan.stats.mode == "request")
    scan.beams(3)


def test_changed_settings_reach_the_head(port):
    scan = VirtualScan(port)
    scan.beams(3)
    scan.settings = SETTINGS.changed({"sector_width_deg": 18.0, "max_range": 2.0, "gain_setting": 2})
    scan.until(lambda: scan.pings[-1].beam.sector == (190, 210, 1))
    pulse = scan.pings[-1].beam.pulse
    assert pulse.gain_setting == 2
    assert pulse.number_of_samples * bin_length(pulse.sample_period, 1500.0) == pytest.approx(2.0, rel=0.005)


def test_a_pulse_too_long_for_the_head_comes_back_as_the_head_made_it(port):
    scan = VirtualScan(port)
    too_long = ScanCommand(PulseSettings(1, 500, 80, 750, 440))
    scan.settings = SimpleNamespace(command=lambda: too_long)
    scan.beams(20)
    assert scan.pings[-1].beam.pulse.transmit_duration == 128
    assert scan.stats.details()["transmit duration [us]"] == "128"


def test_a_sector_across_astern_is_asked_for_ping_by_ping(port):
    scan = VirtualScan(port, SETTINGS.changed({"sector_width_deg": 18.0, "train_angle_deg": 180.0}))
    scan.beams(15)
    assert scan.angles == [*range(390, 400), *range(5)]
    assert scan.stats.mode == "request"


@MODES
@pytest.mark.parametrize("max_range", [1.0, 20.0])
def test_stamps_are_when_the_pings_left(port, settings, max_range):
    scan = VirtualScan(port, settings.changed({"max_range": max_range}), baud_rate=115200)
    scan.beams(20)
    assert [ping.stamp for ping in scan.pings] == pytest.approx(scan.echoes.times[:20], abs=1e-4)


@MODES
@pytest.mark.parametrize(
    ("fault", "count"),
    [
        (Fault.GARBLED, "bad_frames"),
        (Fault.TRUNCATED, "bad_frames"),
        (Fault.DOUBLED, "unexpected_replies"),
        (Fault.REFUSED, "refusals"),
    ],
)
def test_each_fault_is_counted_and_every_good_beam_delivered(port, settings, injector, fault, count):
    scan = VirtualScan(port, settings, injector)
    scan.beams(2)
    injector.order(fault)
    scan.until(lambda: getattr(scan.stats, count) == 1)
    scan.beams(3)
    lost = {2} if count == "bad_frames" else set()
    assert scan.numbers == [one for one in range(scan.numbers[-1] + 1) if one not in lost]
    assert scan.stats.timeouts == 0


def test_a_beam_that_the_head_lost_is_missed(port, injector):
    scan = VirtualScan(port, SETTINGS, injector)
    scan.beams(2)
    injector.order(Fault.DROPPED)
    scan.until(lambda: scan.stats.missing_beams == 1)
    assert scan.stats.timeouts == 0


def test_a_request_without_reply_is_a_timeout(port, injector):
    scan = VirtualScan(port, REQUESTS, injector)
    scan.beams(2)
    injector.order(Fault.DROPPED)
    scan.until(lambda: scan.stats.timeouts == 1)
    scan.beams(2)
    assert scan.numbers == [0, 1, 3, 4]


def test_a_late_reply_is_not_taken_for_the_answer_to_the_next_request(port, injector):
    scan = VirtualScan(port, REQUESTS, injector)
    scan.beams(2)
    injector.order(Fault.LATE)
    scan.until(lambda: scan.stats.unexpected_replies == 1)
    scan.beams(2)
    assert all(ping.beam.angle == number for ping, number in zip(scan.pings, scan.numbers))


@MODES
@pytest.mark.parametrize("fault", [Fault.SILENCE, Fault.DISAPPEARANCE])
@pytest.mark.parametrize("absence", [1.0, 7.3, 100.0])
def test_the_scan_goes_on_within_two_seconds_after_the_head_was_away(port, settings, fault, absence):
    injector = FaultInjector(EmulatorParameters(silence_duration=absence, absence_duration=absence))
    scan = VirtualScan(port, settings, injector, stop=VirtualStopAt(VirtualTime(), absence + 5.0))
    injector.order(Fault.NONE)
    injector.order(fault)
    scan.scan()
    gaps = np.diff([ping.stamp for ping in scan.pings])
    assert absence < max(gaps) < absence + 2.0


@MODES
@pytest.mark.parametrize("fault", [Fault.NONE, Fault.SILENCE, Fault.DISAPPEARANCE])
def test_a_stop_ends_the_scan_at_once(port, settings, fault):
    injector = FaultInjector(EmulatorParameters(silence_duration=60.0, absence_duration=60.0))
    scan = VirtualScan(port, settings, injector, stop=VirtualStopAt(VirtualTime(), 3.0))
    injector.order(fault)
    scan.scan()
    assert scan.device.stop.time.now < 3.0 + 0.2


@MODES
def test_every_ping_ends_in_exactly_one_count(port, settings, injector):
    scan = VirtualScan(port, settings, injector)
    scan.beams(1)
    for fault in (Fault.DROPPED, Fault.GARBLED, Fault.DOUBLED, Fault.REFUSED):
        injector.order(fault)
    scan.beams(5)
    stats = scan.stats
    assert stats.pings == stats.replies + stats.timeouts + stats.bad_frames + stats.refusals + stats.interrupted
