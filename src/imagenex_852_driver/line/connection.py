"""Parameters of the serial line and its timeouts."""

from dataclasses import dataclass

from imagenex_852_driver.line.timing import LineTiming
from node_support.parameters import ParameterError, ParameterSet, parameter


@dataclass(frozen=True)
class ConnectionParameters(ParameterSet):
    """Where the head is connected and how long to wait for it."""

    port: str = parameter("/dev/ttyUSB0", "device or pyserial URL (socket://, rfc2217://, loop://)", tunable=False)
    baud_rate: int = parameter(115200, "speed of the line, 8N1", unit="bit/s", low=1200, tunable=False)
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
    back_off_first: float = parameter(
        0.1, "wait before the first attempt to reopen the port", unit="s", low=0.01, high=1.0, tunable=False
    )
    back_off_longest: float = parameter(
        1.0,
        "longest wait between attempts; each wait is twice the previous one",
        unit="s",
        low=0.01,
        high=1.5,
        tunable=False,
    )
    reopen_after: float = parameter(
        5.0, "time without a reply after which the port is reopened", unit="s", low=0.1, tunable=False
    )

    def check(self) -> None:
        """Raise ParameterError if the first wait is longer than the longest."""
        if self.back_off_first > self.back_off_longest:
            raise ParameterError(
                f"back_off_first = {self.back_off_first}: longer than back_off_longest = {self.back_off_longest}"
            )

    def timing(self) -> LineTiming:
        """Return the timing of pings on this line."""
        return LineTiming(self.baud_rate, self.speed_of_sound)
