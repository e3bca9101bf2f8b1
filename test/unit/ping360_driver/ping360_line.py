"""An emulated Ping360 on a line with a driver on it; its pings carry their numbers."""

import threading
import time
from contextlib import contextmanager

from numbered_pings import NumberedEchoes

from ping360_driver.emulator import EmulatedPing360
from ping360_driver.line.device import Ping360Device
from ping360_driver.line.parameters import ConnectionParameters
from ping360_driver.protocol.settings import HeadSettings
from sonar_driver.emulator import HeadServer, PtyLine, UdpLine
from sonar_driver.line.port import datagram_address, is_datagram_port
from sonar_driver.line.scanner import Scanner

BAUD_RATE = 1152000
# The shortest beams: 1.3 ms of listening, 2 ms of sending.
SETTINGS = HeadSettings(max_range=1.0, data_points=200)
PATIENCE = 60.0
_POLL = 0.01


def connection_to(port, **changes):
    """Return the parameters of a fast line, on a machine that may be busy."""
    fast = {"baud_rate": BAUD_RATE, "reply_margin": 2.0, "late_window": 0.3, "byte_gap": 0.05, "back_off_first": 0.02}
    return ConnectionParameters(port=port, **{**fast, **changes})


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


class Run:
    """A scanner in a thread, with the pings it delivered."""

    def __init__(self, connection, settings=SETTINGS):
        self.pings = []
        self.device = Ping360Device(connection, threading.Event())
        self.scanner = Scanner(self.device, settings.command(), self._note)
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self.scanner.run, daemon=True)

    def __enter__(self):
        self.scanner.connect()
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self.stop()

    @property
    def stats(self):
        return self.device.stats

    @property
    def angles(self):
        return [ping.beam.angle for ping in self.pings]

    def stop(self, timeout=PATIENCE):
        """Stop; return whether the thread ended in time."""
        self.device.stop.set()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def wait(self, ready, timeout=PATIENCE):
        """Wait until the pings, or the counts, satisfy `ready`; return whether they do."""
        end = time.monotonic() + timeout
        with self._news:
            while not ready(self.pings) and time.monotonic() < end:
                # Counts change without news.
                self._news.wait(_POLL)
            return ready(self.pings)

    def wait_for_more(self, count=1, timeout=PATIENCE):
        """Wait for `count` more pings than there are now; return whether they came."""
        wanted = len(self.pings) + count
        return self.wait(lambda pings: len(pings) >= wanted, timeout)

    def _note(self, ping):
        with self._news:
            self.pings.append(ping)
            self._news.notify_all()


@contextmanager
def running(port, settings=SETTINGS, faults=None, head=None, **changes):
    """Yield a driver that scans with an emulated head, and the server of that head."""
    server = HeadServer(head or emulated(port, faults), served_line(port))
    with server, Run(connection_to(port, **changes), settings) as scan:
        yield scan, server
