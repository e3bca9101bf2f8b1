"""An emulated Ping360 on a line with a driver on it; its pings carry their numbers."""

import threading
from contextlib import contextmanager

from numbered_pings import NumberedEchoes
from scanning import Scanning

from ping360_driver.emulated_ping360 import EmulatedPing360
from ping360_driver.line.device import Ping360Device
from ping360_driver.line.parameters import HeadSettings
from sonar_driver.emulator.head_server import HeadServer, PtyLine, UdpLine
from sonar_driver.line.parameters import LineParameters
from sonar_driver.line.port import datagram_address, is_datagram_port

BAUD_RATE = 1152000
# The shortest beams: 1.3 ms of listening, 2 ms of sending.
SETTINGS = HeadSettings(max_range=1.0, data_points=200)


def connection_to(port, **changes):
    """Return the parameters of a fast line, on a machine that may be busy."""
    fast = {"baud_rate": BAUD_RATE, "reply_margin": 2.0, "late_window": 0.3, "byte_gap": 0.05, "back_off_first": 0.02}
    return LineParameters(port=port, **{**fast, **changes})


def emulated(port, faults=None, **options):
    """Return a head for a port, whose echoes begin with the number of the ping."""
    baud_rate = float("inf") if is_datagram_port(port) else BAUD_RATE
    return EmulatedPing360(NumberedEchoes(), faults, baud_rate, **options)


def served_line(port):
    """Return the head's end of a port."""
    return UdpLine(*datagram_address(port)) if is_datagram_port(port) else PtyLine(port)


def number(ping):
    """Return the number of a ping, as its echoes tell it."""
    return int.from_bytes(ping.beam.echoes[:4], "big")


def scanning(connection, settings=SETTINGS):
    """Return a driver that scans in a thread."""
    return Scanning(Ping360Device(connection, threading.Event()), settings.command())


@contextmanager
def running(port, settings=SETTINGS, faults=None, head=None, **changes):
    """Yield a driver that scans with an emulated head, and the server of that head."""
    server = HeadServer(head or emulated(port, faults), served_line(port))
    with server, scanning(connection_to(port, **changes), settings) as scan:
        yield scan, server
