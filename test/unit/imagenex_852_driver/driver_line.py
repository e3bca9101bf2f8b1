"""An emulated head on a pseudo-terminal with a driver on it, ten times as fast as the real ones."""

import threading
from contextlib import contextmanager
from typing import List

from imagenex_852_driver.emulator import Emulated852
from imagenex_852_driver.line.connection import ConnectionParameters
from imagenex_852_driver.line.device import Ping, SonarDevice
from imagenex_852_driver.protocol.settings import HeadSettings
from sonar_driver.emulator import HeadServer, PtyLine
from sonar_driver.line.scanner import Scanner

FAST = {
    "baud_rate": 1152000,
    "speed_of_sound": 15000.0,
    # On a machine that may be busy.
    "reply_margin": 1.0,
    "late_window": 0.3,
    "byte_gap": 0.3,
    "back_off_first": 0.02,
}
PATIENCE = 60.0


@contextmanager
def served(tmp_path, head=None, **changes):
    """Yield the server of an emulated head and the parameters to connect to it."""
    connection = ConnectionParameters(port=str(tmp_path / "sonar"), **{**FAST, **changes})
    head = head or Emulated852(timing=connection.timing())
    with HeadServer(head, PtyLine(connection.port)) as server:
        yield server, connection


class Run:
    """A scanner in a thread, with the pings it delivered."""

    def __init__(self, connection, settings=None):
        self.pings: List[Ping] = []
        self.device = SonarDevice(connection, threading.Event())
        self.scanner = Scanner(self.device, (settings or HeadSettings(max_range=50)).command(), self._note)
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self.scanner.run, daemon=True)

    def __enter__(self):
        self.scanner.connect()
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self.stop()

    def stop(self, timeout=PATIENCE):
        """Stop; return whether the thread ended in time."""
        self.device.stop.set()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def wait_for_more(self, count=1, timeout=PATIENCE):
        """Wait for `count` more pings than there are now; return whether they came."""
        with self._news:
            wanted = len(self.pings) + count
            return self._news.wait_for(lambda: len(self.pings) >= wanted, timeout)

    def _note(self, ping):
        with self._news:
            self.pings.append(ping)
            self._news.notify_all()
