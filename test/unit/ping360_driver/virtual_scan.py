"""A driver that scans with an emulated Ping360 in virtual time: always the same, however busy the machine is."""

from numbered_pings import NumberedEchoes
from ping360_line import BAUD_RATE, SETTINGS, connection_to, number
from virtual_line import VirtualLine, VirtualStop, VirtualTime

from ping360_driver.emulated_ping360 import EmulatedPing360
from ping360_driver.line.device import Ping360Device
from sonar_driver.line.device import Scanner
from sonar_driver.line.port import is_datagram_port

_MOST_PINGS = 1000


class TimedEchoes(NumberedEchoes):
    """Remembers when each ping left."""

    def __init__(self):
        super().__init__()
        self.times = []

    def echoes(self, ping):
        self.times.append(ping.time)
        return super().echoes(ping)


class VirtualScan:
    """Pings on request of a test; `pings` are those that brought a beam. head: the class of the head."""

    def __init__(
        self, port="virtual", settings=SETTINGS, faults=None, baud_rate=BAUD_RATE, stop=None, head=EmulatedPing360
    ):
        self.settings = settings
        self.pings = []
        self.echoes = TimedEchoes()
        stop = stop or VirtualStop(VirtualTime())
        head_rate = float("inf") if is_datagram_port(port) else baud_rate
        self.head = head(self.echoes, faults, head_rate)
        line = VirtualLine(self.head, head_rate, stop.time)
        connection = connection_to(port, baud_rate=baud_rate, reply_margin=0.15)
        clock = stop.time.elapsed
        self.device = Ping360Device(connection, stop, clock, clock, line.open)
        self.device.open()

    def scan(self):
        """Ping as a scanner does, until the stop event is set."""
        Scanner(self.device, self.settings.command(), self.pings.append).run()

    @property
    def stats(self):
        return self.device.stats

    @property
    def angles(self):
        return [ping.beam.angle for ping in self.pings]

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
