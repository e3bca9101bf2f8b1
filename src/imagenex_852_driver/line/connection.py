"""Parameters of the serial line and its timeouts."""

from dataclasses import dataclass

from imagenex_852_driver.line.timing import LineTiming
from node_support.parameters import parameter
from sonar_driver.line.parameters import LineParameters


@dataclass(frozen=True)
class ConnectionParameters(LineParameters):
    """Where the head is connected and how long to wait for it."""

    speed_of_sound: float = parameter(
        1500.0, "speed of sound that the head assumes", unit="m/s", low=1000.0, tunable=False
    )
    reply_margin: float = parameter(
        0.25,
        "how long to wait for a reply beyond the sound's travel time and the switch delay",
        unit="s",
        low=0.01,
        high=1.0,
        tunable=False,
    )
    late_window: float = parameter(
        0.25,
        "how long to wait after a timeout for a late reply, so that the next ping does not get it",
        unit="s",
        low=0.0,
        high=1.0,
        tunable=False,
    )
    byte_gap: float = parameter(
        0.1, "silence that ends an incomplete reply", unit="s", low=0.01, high=1.0, tunable=False
    )

    def timing(self) -> LineTiming:
        """Return the timing of pings on this line."""
        return LineTiming(self.baud_rate, self.speed_of_sound)
