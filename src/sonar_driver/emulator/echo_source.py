"""Where the emulated head's echoes come from."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass


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
