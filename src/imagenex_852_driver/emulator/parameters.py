"""Parameters of the emulated head: those of every head, and what only the 852 has."""

from dataclasses import dataclass

from imagenex_852_driver.line.timing import LineTiming
from imagenex_852_driver.protocol.errors import HEAD_IDS, SONAR_HEAD_ID
from node_support.parameters import parameter, with_defaults
from sonar_driver.emulator.faults import FaultRates
from sonar_driver.emulator.parameters import EmulatedHeadParameters


@dataclass(frozen=True)
class FaultRates852(FaultRates):
    """The faults of this head."""

    overrun: float = parameter(0.0, "share of replies that report a character overrun", low=0.0, high=1.0)


@dataclass(frozen=True)
@with_defaults(link="/tmp/imagenex_852")
class EmulatorParameters(EmulatedHeadParameters, FaultRates852):
    """Parameters of imagenex_852_emulator."""

    head_id: int = parameter(
        SONAR_HEAD_ID, "identification of the head", low=HEAD_IDS[0], high=HEAD_IDS[-1], tunable=False
    )

    def timing(self) -> LineTiming:
        """Return the timing of pings on this line."""
        return LineTiming(self.baud_rate, self.speed_of_sound)
