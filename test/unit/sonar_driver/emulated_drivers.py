"""Drivers of every sonar with an emulated head: on a real port in threads, and in virtual time."""

import math
import socket
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Callable, List, Tuple

from virtual_line import VirtualLine, VirtualTime

from imagenex_852_driver import emulated_852
from imagenex_852_driver import parameters as parameters_852
from imagenex_852_driver.device import SonarDevice
from node_support.parameters import ParameterSet
from ping360_driver import emulated_ping360
from ping360_driver.device import Ping360Device
from ping360_driver.parameters import HeadSettings
from sonar_driver.device import LineDevice
from sonar_driver.emulated_head import Fault, FaultInjector, FaultRates
from sonar_driver.head_server import HeadServer, PtyLine, UdpLine
from sonar_driver.port import LineParameters, PortUnavailableError, datagram_address, is_datagram_port

PATIENCE = 60.0
EPOCH = 1000.0
"""s: what stamps say when virtual time begins."""
# On a machine that may be busy.
FAST = {"baud_rate": 1152000, "reply_margin": 2.0, "late_window": 0.3, "byte_gap": 0.3, "back_off_first": 0.02}
# Nothing is late in virtual time but what should be.
EXACT = {"reply_margin": 0.15, "byte_gap": 0.05}
# Faults of which no ping comes.
WITHOUT_PING = (Fault.SILENCE, Fault.DISAPPEARANCE, Fault.REFUSED)
_POLL = 0.01
_MOST_PINGS = 1000


@dataclass(frozen=True)
class Sonar:
    """A sonar's driver and head.

    good: faults in spite of which a ping brings its beam. optional: those in spite of which it may.
    """

    device: Callable[..., LineDevice]
    head: type
    rates: Callable[..., FaultRates]
    settings: ParameterSet
    connection: LineParameters
    good: Tuple[Fault, ...]
    optional: Tuple[Fault, ...] = ()

    def emulated(self, connection, faults=None, echoes=None, head=None, **told):
        """Return a head on a line; `head` is another class of it, `told` are other parameters than the line's."""
        line = {"baud_rate": connection.baud_rate, "speed_of_sound": getattr(connection, "speed_of_sound", 1500.0)}
        parameters = self.rates(link=connection.port, **{**line, **told})
        return (head or self.head)(parameters, echoes or NumberedEchoes(), faults)


IMAGENEX_852 = Sonar(
    device=SonarDevice,
    head=emulated_852.Emulated852,
    rates=emulated_852.EmulatorParameters,
    settings=parameters_852.HeadSettings(max_range=50),
    connection=parameters_852.ConnectionParameters(speed_of_sound=15000.0, **FAST),
    good=(Fault.NONE, Fault.DOUBLED, Fault.OVERRUN),
)
PING360 = Sonar(
    device=Ping360Device,
    head=emulated_ping360.EmulatedPing360,
    rates=emulated_ping360.EmulatorParameters,
    # The shortest beams: 1.3 ms of listening, 2 ms of sending.
    settings=HeadSettings(max_range=1.0, data_points=200),
    connection=LineParameters(**FAST),
    good=(Fault.NONE, Fault.DOUBLED, Fault.LATE),
)
# A request is answered in time if the head was given the time for a whole turn.
PING360_REQUESTS = replace(
    PING360,
    settings=PING360.settings.changed({"scan_mode": "request"}),
    good=(Fault.NONE, Fault.DOUBLED),
    optional=(Fault.LATE,),
)
SONARS = {"imagenex_852": IMAGENEX_852, "ping360": PING360, "ping360_requests": PING360_REQUESTS}


class NumberedEchoes:
    """Writes the number of the ping into the first echoes, and remembers when each ping left."""

    def __init__(self):
        self.times = []

    def __call__(self, ping):
        self.times.append(ping.time)
        return (len(self.times) - 1).to_bytes(4, "big") + bytes(ping.bin_count - 4)


def number(ping):
    """Return the number of a ping, as its echoes tell it."""
    echoes = ping.beam.echoes if hasattr(ping, "beam") else ping.reply.echoes
    return int.from_bytes(echoes[:4], "big")


class RecordingInjector(FaultInjector):
    """Remembers the fault of every ping, and stops the driver after a number of commands."""

    def __init__(self, rates, seed, commands, stop):
        super().__init__(rates, seed)
        self.of_pings: List[Fault] = []
        self._left = commands
        self._stop = stop

    def next(self):
        self._left -= 1
        if self._left < 0:
            self._stop.set()
            self.counts[Fault.DROPPED] += 1
            self.of_pings.append(Fault.DROPPED)
            return Fault.DROPPED
        fault = super().next()
        if fault not in WITHOUT_PING:
            self.of_pings.append(fault)
        return fault


def wait_until(ready):
    """Wait until `ready`, on a machine that may be busy; return whether it came to that."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if ready():
            return True
        time.sleep(_POLL)
    return False


class Scanning:
    """A driver in a thread, with the pings it delivered."""

    def __init__(self, sonar, connection, settings=None):
        self.pings = []
        self.device = sonar.device(connection, threading.Event())
        self.device.command = (settings or sonar.settings).command()
        self._thread = threading.Thread(target=self.device.run, args=(self.pings.append,), daemon=True)

    def __enter__(self):
        with suppress(PortUnavailableError):
            self.device.open()
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self.stop()

    @property
    def stats(self):
        return self.device.stats

    def stop(self):
        """Stop; return whether the thread ended in time."""
        self.device.stop.set()
        self._thread.join(PATIENCE)
        return not self._thread.is_alive()

    def wait_for_more(self, count=1):
        """Wait for `count` more pings than there are now; return whether they came."""
        wanted = len(self.pings) + count
        return wait_until(lambda: len(self.pings) >= wanted)


class HideableServer(HeadServer):
    """A server whose line can be taken away and brought back; both are done when the methods return."""

    def disappear(self):
        self.head.absent_from, self.head.absent_until = -math.inf, math.inf
        self._wait_until_present_is(False)

    def reappear(self):
        self.head.absent_until = -math.inf
        self._wait_until_present_is(True)

    def _wait_until_present_is(self, wanted):
        self._wake()
        wait_until(lambda: self._present is wanted)


@contextmanager
def served(sonar, port, head=None, **changes):
    """Yield the server of an emulated head, and the parameters to connect to it."""
    connection = replace(sonar.connection, port=str(port), **changes)
    name = connection.port
    line = UdpLine(*datagram_address(name)) if is_datagram_port(name) else PtyLine(name)
    with HideableServer(head or sonar.emulated(connection), line) as server:
        yield server, connection


@contextmanager
def running(sonar, port, settings=None, head=None):
    """Yield a driver that scans with an emulated head, and the server of that head."""
    with served(sonar, port, head) as (server, connection), Scanning(sonar, connection, settings) as scan:
        yield scan, server


def free_udp_port():
    """Return the name of a UDP port of this computer that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"udp://127.0.0.1:{probe.getsockname()[1]}"


class VirtualScan:
    """A driver in virtual time, always the same however busy the machine is; `pings` brought a beam.

    head: the class of the head. told: parameters of the head. changes: of the line's parameters.
    """

    def __init__(self, sonar, port="virtual", settings=None, faults=None, time=None, head=None, told=(), **changes):
        self.settings = settings or sonar.settings
        self.pings = []
        self.echoes = NumberedEchoes()
        self.time = time or VirtualTime()
        connection = replace(sonar.connection, port=port, **{**EXACT, **changes})
        self.head = sonar.emulated(connection, faults, self.echoes, head, **dict(told))
        baud_rate = math.inf if is_datagram_port(port) else connection.baud_rate
        line = VirtualLine(self.head, baud_rate, self.time)
        self.device = sonar.device(connection, self.time, self.clock, self.time.elapsed, line.open)
        self.device.open()

    def clock(self):
        """Return the time that stamps tell, s."""
        return EPOCH + self.time.now

    def scan(self):
        """Ping as a scanner does, until the stop event is set."""
        self.device.command = self.settings.command()
        self.device.run(self.pings.append)

    @property
    def stats(self):
        return self.device.stats

    @property
    def numbers(self):
        return [number(ping) for ping in self.pings]

    def until(self, ready):
        """Ping until `ready`; fails when that does not come."""
        for _ in range(_MOST_PINGS):
            if ready():
                return
            ping = self.device.ping(self.settings.command())
            if ping is not None:
                self.pings.append(ping)
        raise AssertionError(f"not within {_MOST_PINGS} pings: {self.stats}")

    def beams(self, count):
        """Ping until so many more beams have come."""
        wanted = len(self.pings) + count
        self.until(lambda: len(self.pings) >= wanted)
