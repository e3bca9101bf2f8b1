"""Every parameter of the driver in one set: the line, the head and how its beams are published."""

from dataclasses import dataclass

from node_support.parameters import parameter
from ping360_driver.protocol.settings import HeadSettings
from sonar_driver.line.parameters import LineParameters, MountingParameters


@dataclass(frozen=True)
class ConnectionParameters(LineParameters):
    """Where the head is connected and how long to wait for it."""

    reply_margin: float = parameter(
        0.25,
        "how long to wait for a beam beyond the time that turning, listening and sending take",
        unit="s",
        low=0.01,
        high=4.0,
        tunable=False,
    )
    late_window: float = parameter(
        0.25,
        "how long to wait after a timeout for a late reply, before the next request is sent",
        unit="s",
        low=0.0,
        high=4.0,
        tunable=False,
    )
    byte_gap: float = parameter(
        0.1, "silence that ends an incomplete message", unit="s", low=0.01, high=1.0, tunable=False
    )


@dataclass(frozen=True)
class DriverParameters(MountingParameters, HeadSettings, ConnectionParameters):
    """Parameters of ping360_driver; usable wherever a `HeadSettings` or `ConnectionParameters` is expected."""

    port: str = parameter(
        "/dev/ttyUSB0", "device, pyserial URL (socket://, rfc2217://) or udp://HOST:PORT", tunable=False
    )

    def check(self) -> None:
        """Raise ParameterError when settings of the head, or of the line, do not fit together."""
        HeadSettings.check(self)
        ConnectionParameters.check(self)
