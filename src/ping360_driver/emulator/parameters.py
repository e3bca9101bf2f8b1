"""Parameters of the emulated head: those of every head, and what only the Ping360 has."""

from dataclasses import dataclass

from node_support.parameters import parameter, with_defaults
from sonar_driver.emulator.faults import FaultRates
from sonar_driver.emulator.parameters import EmulatedHeadParameters


@dataclass(frozen=True)
class Ping360FaultRates(FaultRates):
    """The faults of this head."""

    refused: float = parameter(0.0, "share of replies instead of which the head refuses", low=0.0, high=1.0)


@dataclass(frozen=True)
@with_defaults(beam_height_deg=25.0, beam_width_deg=2.0)
class EmulatorParameters(EmulatedHeadParameters, Ping360FaultRates):
    """Parameters of ping360_emulator."""

    link: str = parameter(
        "/tmp/ping360", "path at which the port appears, or udp://HOST:PORT to listen at", tunable=False
    )
    auto_transmit: bool = parameter(
        True, "the firmware can scan a sector by itself; older ones need a request per ping", tunable=False
    )
