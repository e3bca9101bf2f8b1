import time

import pytest
from ping360_line import SETTINGS, connection_to, emulated, running, scanning, served_line
from scanning import PATIENCE

from ping360_driver.emulated_ping360 import EmulatedPing360
from ping360_driver.line.device import Ping360Device
from ping360_driver.protocol.messages import MessageId, packed
from sonar_driver.emulator.head_server import HeadServer, PtyLine
from sonar_driver.line.port import PortUnavailableError

REQUESTS = SETTINGS.changed({"scan_mode": "request"})


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
