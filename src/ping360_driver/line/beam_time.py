"""How long a beam takes: turning, listening for echoes, and sending them."""

from ping360_driver.protocol.angles import TURN
from ping360_driver.protocol.messages import CHECKSUM_LENGTH, HEADER_LENGTH
from ping360_driver.protocol.scan_command import PulseSettings
from sonar_driver.line.timing import transmission_time

# s: a full turn takes 2.4 s by Ping Viewer's constants, and no command more than 4 s by the ping protocol.
_SLOWEST_TURN = 4.0
_BEAM_HEADER = 20  # Bytes of an AUTO_DEVICE_DATA message besides its samples; a DEVICE_DATA message has fewer


def turning_time(gradians: int) -> float:
    """Return how long the head takes at most to turn by so many gradians, in seconds."""
    return _SLOWEST_TURN * gradians / TURN


def sending_time(pulse: PulseSettings, baud_rate: float) -> float:
    """Return how long a beam takes on the line, in seconds."""
    length = HEADER_LENGTH + _BEAM_HEADER + pulse.number_of_samples + CHECKSUM_LENGTH
    return transmission_time(length, baud_rate)


def beam_time(step: int, pulse: PulseSettings, baud_rate: float) -> float:
    """Return how long it takes at most from one beam to the next, `step` gradians further, in seconds.

    baud_rate: bits per second.
    """
    return turning_time(step) + pulse.listening_time + sending_time(pulse, baud_rate)
