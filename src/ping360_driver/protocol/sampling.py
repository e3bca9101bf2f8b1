"""Sample period, number of samples and length of the pulse, from the range; what the device allows.

Sources: the ping protocol's definition of the Ping360's messages, and Ping Viewer (src/sensor/ping360.h), which names
the limits of the firmware and its engineer's rule for the pulse.
"""

from typing import Tuple

TICK = 25e-9  # s: the unit of the sample period
SAMPLES = (200, 1200)  # Least and most of a beam
PERIOD_TICKS = (80, 40000)  # Shortest and longest sample period
PULSE_US = (5, 500)  # Shortest and longest pulse that the firmware makes

_PULSE_US_PER_TRAVEL_SECOND = 8000  # Pulse in us for each second that sound takes to the range, one way
_PULSE_PERIODS = 2.5  # A shorter pulse would fall between two samples
_LONGEST_PULSE_PERIODS = 64  # The firmware cuts longer ones, to protect its transmitter


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
