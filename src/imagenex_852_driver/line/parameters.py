"""Every parameter of the driver in one set: the line, the head and how its beams are published."""

from dataclasses import dataclass

from imagenex_852_driver.line.connection import ConnectionParameters
from imagenex_852_driver.protocol.settings import HeadSettings
from sonar_driver.line.parameters import MountingParameters


@dataclass(frozen=True)
class DriverParameters(MountingParameters, HeadSettings, ConnectionParameters):
    """Parameters of imagenex_852_driver; usable wherever a `HeadSettings` or `ConnectionParameters` is expected."""

    def check(self) -> None:
        """Raise ParameterError when settings of the head, or of the line, do not fit together."""
        HeadSettings.check(self)
        ConnectionParameters.check(self)
