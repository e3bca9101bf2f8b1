"""The frame of every emulated head: where echoes come from, how faults strike replies, and how these are paced."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import List, NamedTuple, Optional

from sonar_driver.emulator.faults import Fault, FaultInjector
from sonar_driver.line.port import transmission_time

# A serial adapter passes on the bytes of a reply in pieces of about this size.
_PIECE = 64


@dataclass(frozen=True)
class PingRequest:
    """One ping of the emulated head.

    `angle` in radians, counter-clockwise, of a head mounted upright; `time` in seconds of the emulator's
    clock; `max_range` in metres; `gain_db` above the gain at which echoes have their usual strength.
    """

    time: float
    angle: float
    bin_count: int
    max_range: float
    gain_db: float


class EchoSource(ABC):
    """Answers pings with echo strengths, as the simulator's ray caster does."""

    @abstractmethod
    def echoes(self, ping: PingRequest) -> bytes:
        """Return `ping.bin_count` echo strengths (0 to 255), nearest bin first."""


class FixedPattern(EchoSource):
    """The four walls of a square basin with the head at its centre: each wall is a blurred peak above weak ringing."""

    WALL_BLUR = 0.1
    RINGING_REACH = 0.3

    def __init__(self, wall_distance: float = 4.0) -> None:
        """`wall_distance` is the shortest distance from the head to each wall, in metres."""
        self._wall_distance = wall_distance

    def echoes(self, ping: PingRequest) -> bytes:
        """Return the echoes of the wall in the direction of the ping, scaled by the gain."""
        wall = self._wall_distance / max(abs(math.cos(ping.angle)), abs(math.sin(ping.angle)))
        strength = 127 * 10 ** (ping.gain_db / 20)
        resolution = ping.max_range / ping.bin_count
        ranges = ((index + 0.5) * resolution for index in range(ping.bin_count))
        return bytes(min(255, round(strength * self._share(distance, wall))) for distance in ranges)

    def _share(self, distance: float, wall: float) -> float:
        ringing = max(0.0, 1.0 - distance / self.RINGING_REACH) / 2
        return max(ringing, math.exp(-0.5 * ((distance - wall) / self.WALL_BLUR) ** 2))


class Transmission(NamedTuple):
    """Bytes that leave the head at `time` (seconds of the caller's clock)."""

    time: float
    data: bytes


class EmulatedHead(ABC):
    """A head in software: bytes and times in, bytes and times out, without its own clock or port.

    From the time `absent_from` until `absent_until`, whoever serves it removes the port. At the time `next_event` it
    does something by itself, and `advance` is to be called.
    """

    def __init__(self, faults: Optional[FaultInjector] = None, baud_rate: float = float("inf")) -> None:
        """`baud_rate` is infinite where bytes take no time and a message is sent as a whole, on a network."""
        self.faults = faults or FaultInjector()
        self.absent_from = float("-inf")
        self.absent_until = float("-inf")
        self.next_event = float("inf")
        self._baud_rate = baud_rate
        self._silent_until = float("-inf")
        self._line_free = float("-inf")

    @abstractmethod
    def receive(self, data: bytes, time: float) -> List[Transmission]:
        """Take bytes that arrived at `time`; return what the head sends in reply, in order of time."""

    def advance(self, time: float) -> List[Transmission]:
        """Return what the head sends without being asked, up to `time`, in order of time."""
        return []

    @abstractmethod
    def _garbled(self, frame: bytes) -> bytes:
        """Return the frame with bytes changed, so that a driver can detect it."""

    def _struck_dumb(self, fault: Fault, time: float, still_unread: float = 0.0) -> bool:
        """Return whether the head says nothing from `time` on, because of `fault` or of an earlier one.

        still_unread: how long the port stays, so that who listens can read what was sent before.
        """
        if fault is Fault.SILENCE:
            self._silent_until = time + self.faults.rates.silence_duration
        if fault is Fault.DISAPPEARANCE:
            self._silent_until = self.absent_from = time + still_unread
            self.absent_until = self.absent_from + self.faults.rates.absence_duration
        return time < self._silent_until or fault is Fault.DISAPPEARANCE

    def _transmissions(self, fault: Fault, frame: bytes, begin: float) -> List[Transmission]:
        """Return the pieces of a reply that begins at `begin` if nothing goes wrong."""
        lateness = self.faults.rates.lateness if fault is Fault.LATE else 0.0
        return self._paced(self._spoilt(fault, frame), begin + lateness)

    def _spoilt(self, fault: Fault, frame: bytes) -> bytes:
        if fault is Fault.DROPPED:
            return b""
        if fault is Fault.GARBLED:
            return self._garbled(frame)
        if fault is Fault.TRUNCATED:
            return self.faults.truncate(frame)
        return frame * 2 if fault is Fault.DOUBLED else frame

    def _paced(self, data: bytes, begin: float) -> List[Transmission]:
        begin = max(begin, self._line_free)
        size = _PIECE if self._baud_rate < float("inf") else max(1, len(data))
        pieces = []
        for start in range(0, len(data), size):
            piece = data[start : start + size]
            pieces.append(Transmission(begin + transmission_time(start + len(piece), self._baud_rate), piece))
        if pieces:
            self._line_free = pieces[-1].time
        return pieces
