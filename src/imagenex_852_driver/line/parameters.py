"""Every parameter of the driver in one set: the line, the head and how its beams are published."""

from dataclasses import dataclass

from imagenex_852_driver.line.connection import ConnectionParameters
from imagenex_852_driver.protocol.settings import HeadSettings
from node_support.parameters import parameter


@dataclass(frozen=True)
class DriverParameters(HeadSettings, ConnectionParameters):
    """Parameters of imagenex_852_driver; usable wherever a `HeadSettings` or `ConnectionParameters` is expected."""

    frame_id: str = parameter("sonar", "frame of the head, in which it tilts but does not turn", tunable=False)
    inverted: bool = parameter(False, "the head is mounted upside down")
    sensor_joint: str = parameter(
        "",
        "joint of /joint_states that tilts the head, for sensorAngle; empty: none",
        tunable=False,
        may_be_empty=True,
    )

    def check(self) -> None:
        """Raise ParameterError when settings of the head, or of the line, do not fit together."""
        HeadSettings.check(self)
        ConnectionParameters.check(self)
