"""The frame of every emulated head: where echoes come from, faults of head and cable, how replies are paced."""

import math
import random
from abc import ABC, abstractmethod
from collections import Counter, deque
from dataclasses import dataclass, fields
from enum import Enum
from typing import Callable, Deque, List, NamedTuple, Optional, Sequence, Tuple

from node_support.parameters import ParameterError, ParameterSet, parameter
from sonar_driver.port import is_datagram_port, transmission_time


class Fault(Enum):
    """What can happen to one reply; a head knows those of which its `FaultRates` has a rate."""

    NONE = "none"
    DROPPED = "dropped"
    GARBLED = "garbled"
    TRUNCATED = "truncated"
    LATE = "late"
    DOUBLED = "doubled"
    OVERRUN = "overrun"
    REFUSED = "refused"
    SILENCE = "silence"
    DISAPPEARANCE = "disappearance"


@dataclass(frozen=True)
class FaultRates(ParameterSet):
    """How often each fault happens, as a share of the replies, and how long silence and absence last."""

    dropped: float = parameter(0.0, "share of replies lost", low=0.0, high=1.0)
    garbled: float = parameter(0.0, "share of replies with broken bytes", low=0.0, high=1.0)
    truncated: float = parameter(0.0, "share of replies cut short", low=0.0, high=1.0)
    late: float = parameter(0.0, "share of replies that come late", low=0.0, high=1.0)
    doubled: float = parameter(0.0, "share of replies sent twice", low=0.0, high=1.0)
    silence: float = parameter(0.0, "share of replies instead of which the head falls silent", low=0.0, high=1.0)
    disappearance: float = parameter(0.0, "share of replies instead of which the port disappears", low=0.0, high=1.0)
    lateness: float = parameter(0.4, "delay of a late reply", unit="s", low=0.0, high=60.0)
    silence_duration: float = parameter(2.0, "length of a silence", unit="s", low=0.0, high=600.0)
    absence_duration: float = parameter(2.0, "time until the port is back", unit="s", low=0.0, high=600.0)

    def check(self) -> None:
        total = sum(self.rate(fault) for fault in Fault)
        if total > 1.0 + 1e-9:
            shares = ", ".join(f"{fault.value} = {self.rate(fault)}" for fault in self.known())
            raise ParameterError(f"{shares}: more than 1 in all")

    def rate(self, fault: Fault) -> float:
        """Return the share of one fault; 0 for NONE, which gets the remaining share, and for one that is not known."""
        return getattr(self, fault.value, 0.0)

    @classmethod
    def known(cls) -> Tuple[Fault, ...]:
        """Return the faults that these heads can have."""
        names = {field.name for field in fields(cls)}
        return tuple(fault for fault in Fault if fault.value in names)


class FaultInjector:
    """Chooses a fault for every command and counts what it chose in `counts`."""

    def __init__(self, rates: FaultRates, seed: int = 0) -> None:
        self.rates = rates
        self.counts: Counter[Fault] = Counter()
        self._ordered: Deque[Fault] = deque()
        self._random = random.Random(seed)

    def order(self, fault: Fault, count: int = 1) -> None:
        """Apply `fault` to the next `count` commands for which no other fault has been ordered."""
        self._ordered.extend([fault] * count)

    def next(self) -> Fault:
        fault = self._ordered.popleft() if self._ordered else self._drawn()
        self.counts[fault] += 1
        return fault

    def garble(self, frame: bytes, echoes: range, telling: Sequence[int]) -> bytes:
        """Return the frame with a tenth of its bytes changed.

        echoes: indices of the bytes that may hold anything. telling: indices of which one is changed for certain, where
        a driver can detect it.
        """
        result = bytearray(frame)
        for index in self._random.sample(echoes, len(frame) // 10):
            result[index] ^= self._random.randint(1, 255)
        index = self._random.choice(telling)
        result[index] = frame[index] ^ 0x55
        return bytes(result)

    def truncate(self, frame: bytes) -> bytes:
        """Return the beginning of the frame: at least one byte, but not the whole frame."""
        return frame[: self._random.randint(1, len(frame) - 1)]

    def _drawn(self) -> Fault:
        value = self._random.random()
        for fault in Fault:
            value -= self.rates.rate(fault)
            if value < 0:
                return fault
        return Fault.NONE


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


EchoSource = Callable[[PingRequest], bytes]
"""Answers a ping with `bin_count` echo strengths (0 to 255), nearest bin first."""
_WALL_BLUR = 0.1  # m
_RINGING_REACH = 0.3  # m


def square_basin(wall_distance: float = 4.0) -> EchoSource:
    """Return the echoes of the four walls of a square basin with the head at its centre, scaled by the gain.

    Each wall is a blurred peak above weak ringing; `wall_distance` is the shortest distance to each, in metres.
    """

    def echoes(ping: PingRequest) -> bytes:
        wall = wall_distance / max(abs(math.cos(ping.angle)), abs(math.sin(ping.angle)))
        strength = 127 * 10 ** (ping.gain_db / 20)
        resolution = ping.max_range / ping.bin_count
        ranges = ((index + 0.5) * resolution for index in range(ping.bin_count))
        return bytes(min(255, round(strength * _share(distance, wall))) for distance in ranges)

    return echoes


def _share(distance: float, wall: float) -> float:
    ringing = max(0.0, 1.0 - distance / _RINGING_REACH) / 2
    return max(ringing, math.exp(-0.5 * ((distance - wall) / _WALL_BLUR) ** 2))


class EchoSourceKind(Enum):
    """Where the echoes come from."""

    PATTERN = "pattern"
    WORLD = "world"


@dataclass(frozen=True)
class EmulatedHeadParameters(FaultRates):
    """Parameters of an emulated head, whatever its protocol."""

    link: str = parameter("/tmp/sonar", "path at which the port appears", tunable=False)
    baud_rate: int = parameter(115200, "speed of the line", unit="bit/s", low=1200, tunable=False)
    speed_of_sound: float = parameter(1500.0, "speed of sound in the water", unit="m/s", low=1000.0, tunable=False)
    seed: int = parameter(0, "seed of the faults and of the noise", low=0, tunable=False)
    echo_source: EchoSourceKind = parameter(
        EchoSourceKind.PATTERN, "four walls of a square basin, or the simulator's ray caster", tunable=False
    )
    wall_distance: float = parameter(4.0, "pattern: distance to walls", unit="m", low=0.1, high=100.0, tunable=False)
    world_file: str = parameter("worlds/basin.sdf", "world: SDF file; relative to the package's folder", tunable=False)
    head_frame: str = parameter(
        "", "world: frame of tf with which the head moves in the frame world; empty: it stands at x, y, z, yaw_deg",
        tunable=False, may_be_empty=True,
    )  # fmt: skip
    x: float = parameter(0.0, "world: position of the head", unit="m", tunable=False)
    y: float = parameter(0.0, "world: position of the head", unit="m", tunable=False)
    z: float = parameter(-2.0, "world: position of the head", unit="m", tunable=False)
    yaw_deg: float = parameter(0.0, "world: heading of the head, counter-clockwise", unit="deg", tunable=False)
    beam_height_deg: float = parameter(
        22.0, "world: height of the beam", unit="deg", low=0.0, high=150.0, tunable=False
    )
    beam_width_deg: float = parameter(2.5, "world: width of the beam", unit="deg", low=0.0, high=150.0, tunable=False)


class Transmission(NamedTuple):
    """Bytes that leave the head at `time` (seconds of the caller's clock)."""

    time: float
    data: bytes


class EmulatedHead(ABC):
    """A head in software: bytes and times in, bytes and times out, without its own clock or port.

    From the time `absent_from` until `absent_until`, whoever serves it removes the port. At the time `next_event` it
    does something by itself, and `advance` is to be called.
    """

    def __init__(
        self,
        parameters: EmulatedHeadParameters,
        echo_source: Optional[EchoSource] = None,
        faults: Optional[FaultInjector] = None,
    ) -> None:
        self.faults = faults or FaultInjector(parameters, parameters.seed)
        self.absent_from = -math.inf
        self.absent_until = -math.inf
        self.next_event = math.inf
        self._parameters = parameters
        self._echoes = echo_source or square_basin(parameters.wall_distance)
        # On a network bytes take no time, and a message is sent as a whole.
        self._baud_rate = math.inf if is_datagram_port(parameters.link) else parameters.baud_rate
        self._silent_until = -math.inf
        self._line_free = -math.inf

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
        if fault is Fault.DROPPED:
            return []
        if fault is Fault.GARBLED:
            frame = self._garbled(frame)
        elif fault is Fault.TRUNCATED:
            frame = self.faults.truncate(frame)
        elif fault is Fault.DOUBLED:
            frame = frame * 2
        lateness = self.faults.rates.lateness if fault is Fault.LATE else 0.0
        return self._paced(frame, begin + lateness)

    def _paced(self, data: bytes, begin: float) -> List[Transmission]:
        begin = max(begin, self._line_free)
        size = _PIECE if self._baud_rate < math.inf else len(data)
        pieces = []
        for start in range(0, len(data), size):
            piece = data[start : start + size]
            pieces.append(Transmission(begin + transmission_time(start + len(piece), self._baud_rate), piece))
        self._line_free = pieces[-1].time
        return pieces
