"""What the driver tells the head: to scan a sector by itself, or to send one ping in one direction."""

from dataclasses import dataclass, field
from enum import Enum

from ping360_driver.protocol.angles import AHEAD, TURN
from ping360_driver.protocol.messages import MessageId, packed
from ping360_driver.protocol.sampling import TICK

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
        """Whether the head turns without end."""
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


def information_request() -> bytes:
    """Return the message that asks the head who it is."""
    return packed(MessageId.GENERAL_REQUEST, requested_id=MessageId.DEVICE_INFORMATION)


def motor_off() -> bytes:
    """Return the message that ends a scan and switches the motor off."""
    return packed(MessageId.MOTOR_OFF)
