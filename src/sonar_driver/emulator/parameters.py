"""Parameters that every emulated head has: where it is served, what it hears and what goes wrong."""

from dataclasses import dataclass
from enum import Enum

from node_support.parameters import parameter
from sonar_driver.emulator.faults import FaultRates


class EchoSourceKind(Enum):
    """Where the echoes come from."""

    PATTERN = "pattern"
    WORLD = "world"


@dataclass(frozen=True)
class EmulatedHeadParameters(FaultRates):
    """Parameters of an emulated head, whatever its protocol."""

    link: str = parameter("/tmp/sonar", "path at which the port appears", tunable=False)
    baud_rate: int = parameter(115200, "speed of the line", unit="bit/s", low=1200, tunable=False)
    speed_of_sound: float = parameter(1500.0, "speed of sound in the water", unit="m/s", low=1000.0, tunable=False)
    seed: int = parameter(0, "seed of the faults and of the noise", low=0, tunable=False)
    echo_source: EchoSourceKind = parameter(
        EchoSourceKind.PATTERN, "four walls of a square basin, or the simulator's ray caster", tunable=False
    )
    wall_distance: float = parameter(
        4.0, "pattern: distance to each wall", unit="m", low=0.1, high=100.0, tunable=False
    )
    world_file: str = parameter("worlds/basin.sdf", "world: SDF file; relative to the package's folder", tunable=False)
    head_frame: str = parameter(
        "", "world: frame of tf with which the head moves in the frame world; empty: it stands at x, y, z, yaw_deg",
        tunable=False, may_be_empty=True,
    )  # fmt: skip
    x: float = parameter(0.0, "world: position of the head", unit="m", tunable=False)
    y: float = parameter(0.0, "world: position of the head", unit="m", tunable=False)
    z: float = parameter(-2.0, "world: position of the head", unit="m", tunable=False)
    yaw_deg: float = parameter(0.0, "world: heading of the head, counter-clockwise", unit="deg", tunable=False)
    beam_height_deg: float = parameter(
        22.0, "world: vertical opening of the beam", unit="deg", low=0.0, high=150.0, tunable=False
    )
    beam_width_deg: float = parameter(
        2.5, "world: horizontal opening of the beam", unit="deg", low=0.0, high=150.0, tunable=False
    )
