"""An emulated head on a pseudo-terminal with a driver on it, ten times as fast as the real ones."""

import threading
from contextlib import contextmanager

from scanning import Scanning

from imagenex_852_driver.emulated_852 import Emulated852
from imagenex_852_driver.line.device import SonarDevice
from imagenex_852_driver.line.parameters import ConnectionParameters, HeadSettings
from sonar_driver.emulator.head_server import HeadServer, PtyLine

FAST = {
    "baud_rate": 1152000,
    "speed_of_sound": 15000.0,
    # On a machine that may be busy.
    "reply_margin": 1.0,
    "late_window": 0.3,
    "byte_gap": 0.3,
    "back_off_first": 0.02,
}


@contextmanager
def served(tmp_path, head=None, **changes):
    """Yield the server of an emulated head and the parameters to connect to it."""
    connection = ConnectionParameters(port=str(tmp_path / "sonar"), **{**FAST, **changes})
    head = head or Emulated852(timing=connection.timing())
    with HeadServer(head, PtyLine(connection.port)) as server:
        yield server, connection


def scanning(connection, settings=None):
    """Return a driver that scans in a thread."""
    device = SonarDevice(connection, threading.Event())
    return Scanning(device, (settings or HeadSettings(max_range=50)).command())
