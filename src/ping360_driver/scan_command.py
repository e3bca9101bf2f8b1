"""What the driver tells the head, to scan a sector by itself or to send one ping in one direction, and what it answers.

The ping protocol counts gradians (0.9 deg) from 0 to 399. Ping Viewer, the manufacturer's program, shows 200 ahead and
turns clockwise, as seen from above when the transducer is on top. What the device allows is from the ping protocol's
definition of its messages, and from Ping Viewer (src/sensor/ping360.h), which names the limits of the firmware and its
engineer's rule for the pulse.
"""

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Optional, Tuple

from ping360_driver.messages import MessageError, MessageId, PingMessage, packed

TURN = 400  # gradians
AHEAD = 200
_RADIANS_PER_GRADIAN = 2 * math.pi / TURN
TICK = 25e-9  # s: the unit of the sample period
SAMPLES = (200, 1200)  # Least and most of a beam
PERIOD_TICKS = (80, 40000)  # Shortest and longest sample period
PULSE_US = (5, 500)  # Shortest and longest pulse that the firmware makes
_PULSE_US_PER_TRAVEL_SECOND = 8000  # Pulse in us for each second that sound takes to the range, one way
_PULSE_PERIODS = 2.5  # A shorter pulse would fall between two samples
_LONGEST_PULSE_PERIODS = 64  # The firmware cuts longer ones, to protect its transmitter
_MODE = 1  # Operating mode of a Ping360 (ping protocol)


class ScanMode(Enum):
    """Who turns the head."""

    AUTO_TRANSMIT = "auto_transmit"
    REQUEST = "request"


@dataclass(frozen=True)
class PulseSettings:
    """How the head pings and listens, in its own units; a beam says of itself what it was made with."""

    gain_setting: int = 1
    transmit_duration: int = 32
    sample_period: int = 80
    transmit_frequency: int = 750
    number_of_samples: int = 200

    @property
    def listening_time(self) -> float:
        """How long the head listens for echoes, in seconds."""
        return self.number_of_samples * self.sample_period * TICK


@dataclass(frozen=True)
class ScanCommand:
    """How to ping and where: a sector about `center`, `width` wide, in steps of `step`, all in gradians.

    `mode` is the mode that the user wants; `can_auto_transmit` says whether the sector allows it.
    """

    pulse: PulseSettings = field(default_factory=PulseSettings)
    mode: ScanMode = ScanMode.AUTO_TRANSMIT
    center: int = AHEAD
    width: int = TURN
    step: int = 1

    @property
    def is_full_turn(self) -> bool:
        return self.width >= TURN

    @property
    def start(self) -> int:
        """The first angle of the sector, in gradians from 0 to 399."""
        return 0 if self.is_full_turn else (self.center - self.width // 2) % TURN

    @property
    def stop(self) -> int:
        """The last angle of the sector, in gradians from 0 to 399."""
        return TURN - 1 if self.is_full_turn else (self.start + self.width) % TURN

    @property
    def can_auto_transmit(self) -> bool:
        """Whether the head can scan this sector by itself: one that has a width and does not lie across astern."""
        return self.mode is ScanMode.AUTO_TRANSMIT and self.start < self.stop

    def auto_transmit(self) -> bytes:
        """Return the message that makes the head scan the sector until it is told otherwise."""
        return packed(
            MessageId.AUTO_TRANSMIT, mode=_MODE, start_angle=self.start, stop_angle=self.stop, num_steps=self.step,
            **vars(self.pulse),
        )  # fmt: skip

    def transducer(self, angle: int) -> bytes:
        """Return the message that asks for one ping at `angle` gradians."""
        return packed(MessageId.TRANSDUCER, mode=_MODE, angle=angle, transmit=1, **vars(self.pulse))


INFORMATION_REQUEST = packed(MessageId.GENERAL_REQUEST, requested_id=MessageId.DEVICE_INFORMATION)
MOTOR_OFF = packed(MessageId.MOTOR_OFF)


class SectorWalk:
    """Goes through a full turn clockwise without end, and through a sector to and fro, from one edge to the other."""

    def __init__(self) -> None:
        self._last: Optional[int] = None
        self._clockwise = True

    def next(self, command: ScanCommand) -> int:
        """Return the angle of the next ping, in gradians from 0 to 399."""
        position = None if self._last is None else (self._last - command.start) % TURN
        if position is None or (position > command.width and not command.is_full_turn):
            self._clockwise = True
            self._last = command.start
        elif command.is_full_turn:
            self._last = (self._last + command.step) % TURN
        else:
            if position == (command.width if self._clockwise else 0):
                self._clockwise = not self._clockwise
            position += command.step if self._clockwise else -command.step
            self._last = (command.start + min(max(position, 0), command.width)) % TURN
        return self._last


def head_angle(gradians: int, inverted: bool = False) -> float:
    """Return the angle of the beam about +z from +x, counter-clockwise radians in [-pi, pi] (REP-103).

    `inverted` means a head whose transducer points down: what it counts clockwise is then counter-clockwise.
    """
    clockwise = (gradians - AHEAD) * _RADIANS_PER_GRADIAN
    return math.remainder(clockwise if inverted else -clockwise, 2 * math.pi)


def gradians(degrees: float) -> int:
    """Return the whole number of gradians nearest to an angle in degrees."""
    return round(degrees * TURN / 360)


def sampling(max_range: float, samples: int, speed_of_sound: float) -> Tuple[int, int]:
    """Return the number of samples, and the sample period in ticks, whose range is nearest to `max_range` [m].

    There are fewer than `samples` where the range is too short for so many.
    """
    ticks = 2 * max_range / (speed_of_sound * TICK)
    number = max(SAMPLES[0], min(samples, int(ticks / PERIOD_TICKS[0])))
    return number, min(max(PERIOD_TICKS[0], round(ticks / number)), PERIOD_TICKS[1])


def bin_length(period_ticks: int, speed_of_sound: float) -> float:
    """Return the length of one range bin in metres: sound travels there and back in one sample period."""
    return period_ticks * TICK * speed_of_sound / 2


def longest_pulse_us(period_ticks: int) -> int:
    """Return the longest pulse that the firmware makes at this sample period, in us."""
    return max(PULSE_US[0], min(PULSE_US[1], int(_LONGEST_PULSE_PERIODS * period_ticks * TICK * 1e6)))


def pulse_us(max_range: float, period_ticks: int, speed_of_sound: float) -> int:
    """Return the pulse in us that suits a range [m]: longer for a longer range, at least 2.5 sample periods."""
    of_range = _PULSE_US_PER_TRAVEL_SECOND * max_range / speed_of_sound
    wanted = round(max(of_range, _PULSE_PERIODS * period_ticks * TICK * 1e6))
    return max(PULSE_US[0], min(longest_pulse_us(period_ticks), wanted))


PING360 = 2  # Device type (ping protocol)
# Ping Viewer lets the head scan by itself from the first firmware after this one.
LAST_WITHOUT_AUTO_TRANSMIT = (3, 3, 0)


@dataclass(frozen=True)
class Beam:
    """One beam, in the head's own units.

    `angle` in gradians from 0 to 399; `echoes` holds one strength (0 to 255) per sample, nearest first; `sector` is
    (start, stop, step) in gradians when the head scans by itself.
    """

    angle: int
    pulse: PulseSettings
    echoes: bytes
    sector: Optional[Tuple[int, int, int]] = None


def beam(message: PingMessage) -> Beam:
    """Return the beam of a DEVICE_DATA or AUTO_DEVICE_DATA message; raises MessageError if it is inconsistent."""
    echoes = bytes(message.data)
    if message.angle >= TURN:
        raise MessageError(f"angle = {message.angle}: must be 0 to {TURN - 1}")
    if message.data_length != len(echoes):
        raise MessageError(f"data_length = {message.data_length}: the message holds {len(echoes)} samples")
    if not message.sample_period:
        raise MessageError("sample_period = 0: must be positive")
    automatic = message.message_id == MessageId.AUTO_DEVICE_DATA
    sector = (message.start_angle, message.stop_angle, message.num_steps) if automatic else None
    return Beam(message.angle, pulse_of(message), echoes, sector)


def pulse_of(message: PingMessage) -> PulseSettings:
    return PulseSettings(**{name: getattr(message, name) for name in PulseSettings.__dataclass_fields__})


def firmware_of(message: PingMessage) -> Tuple[int, int, int]:
    return message.firmware_version_major, message.firmware_version_minor, message.firmware_version_patch


def refusal(message: PingMessage) -> str:
    reason = bytes(getattr(message, "nack_message", b"")).decode("ascii", "replace").strip("\0")
    return f"the head refused message {message.nacked_id}: {reason or 'no reason given'}"
