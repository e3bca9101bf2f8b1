"""Every parameter of the driver: the head's settings, validated before any of them is sent, the line and its timing."""

from dataclasses import dataclass, fields
from enum import Enum
from typing import Union

from imagenex_852_driver.command import LENGTH as COMMAND_LENGTH
from imagenex_852_driver.command import TERMINATOR, SwitchCommand
from imagenex_852_driver.reply import HEAD_IDS, SONAR_HEAD_ID, FrameError
from node_support.parameters import ParameterError, ParameterSet, parameter
from sonar_driver.emulated_head import EmulatedHeadParameters
from sonar_driver.port import LineParameters, MountingParameters, transmission_time

MECHANICAL_LIMIT_DEG = 210  # the head's mechanical stops, to either side of straight ahead


class Direction(Enum):
    """Which way the head turns, seen from above, if it is mounted upright."""

    CLOCKWISE = "clockwise"
    COUNTERCLOCKWISE = "counterclockwise"


@dataclass(frozen=True)
class HeadSettings(ParameterSet):
    """Every setting of the head; angles are degrees, clockwise, as the head counts them.

    Raises ParameterError for a value out of range and for values that do not fit together.
    """

    max_range: int = parameter(20, "range: 5, 10, 20, 30, 40 or 50", unit="m", low=5, high=50, thesis_name="Range")
    direction: Direction = parameter(
        Direction.CLOCKWISE, "how the head turns, seen from above", thesis_name="Direction"
    )
    start_gain_db: int = parameter(20, "receiver gain", unit="dB", low=0, high=40, thesis_name="Gain")
    absorption_db_per_m: float = parameter(
        0.2, "absorption of the water", unit="dB/m", low=0.0, high=2.55, thesis_name="Absorption"
    )
    train_angle_deg: int = parameter(
        0, "centre of the sector, in steps of 3", unit="deg", low=-210, high=210, thesis_name="Train angle"
    )
    sector_width_deg: int = parameter(
        360, "width of the sector, in steps of 3", unit="deg", low=0, high=360, thesis_name="Sector width"
    )
    step_size_deg: int = parameter(3, "turn per ping: 0, 3 or 6", unit="deg", low=0, high=6, thesis_name="Step size")
    pulse_length_us: int = parameter(
        100, "length of the pulse; 253 is not possible", unit="us", low=1, high=255, thesis_name="Pulse length"
    )
    data_points: int = parameter(500, "echoes per beam: 250 or 500", low=250, high=500, thesis_name="Data points")
    switch_delay_ms: int = parameter(
        0, "pause before the reply, in steps of 2; 506 is not possible",
        unit="ms", low=0, high=510, thesis_name="Switch delay",
    )  # fmt: skip
    frequency_khz: int = parameter(675, "frequency: 675 or 850", unit="kHz", low=675, high=850, thesis_name="Frequency")
    head_id: int = parameter(
        SONAR_HEAD_ID, "identification of the head: 16 sonar, 17 to 21 echo sounders",
        low=HEAD_IDS[0], high=HEAD_IDS[-1], tunable=False,
    )  # fmt: skip

    def check(self) -> None:
        super().check()
        self.command()
        reach = abs(self.train_angle_deg) + self.sector_width_deg / 2
        if reach > MECHANICAL_LIMIT_DEG:
            raise ParameterError(
                f"train_angle_deg = {self.train_angle_deg} with sector_width_deg = {self.sector_width_deg}: "
                f"the sector would end at {reach:g} deg, the head stops at {MECHANICAL_LIMIT_DEG} deg"
            )
        if 0 < self.sector_width_deg < self.step_size_deg:
            raise ParameterError(
                f"sector_width_deg = {self.sector_width_deg}: narrower than step_size_deg = {self.step_size_deg}"
            )

    def command(self) -> SwitchCommand:
        same = {one.name: getattr(self, one.name) for one in fields(SwitchCommand) if hasattr(self, one.name)}
        try:
            return SwitchCommand(
                reverse=self.direction is Direction.COUNTERCLOCKWISE,
                absorption_centi_db_per_m=round(self.absorption_db_per_m * 100),
                **same,
            )
        except FrameError as error:
            raise ParameterError(self._terminator_complaint() or str(error)) from error

    def _terminator_complaint(self) -> str:
        sent = {
            "pulse_length_us": self.pulse_length_us,
            "switch_delay_ms": self.switch_delay_ms / 2,
            "absorption_db_per_m": round(self.absorption_db_per_m * 100),
        }
        complaints = [f"{name} = {getattr(self, name)}" for name, byte in sent.items() if byte == TERMINATOR]
        return f"{', '.join(complaints)}: its byte would be 253, which ends a command" if complaints else ""


@dataclass(frozen=True)
class ConnectionParameters(LineParameters):
    """Where the head is connected, and how long its replies take."""

    speed_of_sound: float = parameter(
        1500.0, "speed of sound, as the head has it", unit="m/s", low=1000.0, tunable=False
    )


Line = Union[ConnectionParameters, EmulatedHeadParameters]
"""Either end of the line; both have a baud rate (8N1) and a speed of sound."""


def ping_leaves(line: Line) -> float:
    """Return when the head transmits, in s after the command's first bit: it acts on the last byte of the command."""
    return transmission_time(COMMAND_LENGTH, line.baud_rate)


def reply_begins(line: Line, command: SwitchCommand) -> float:
    """Return when the reply can leave the head at the earliest, in s after the command's first bit.

    That is after the farthest echo and the switch delay.
    """
    travel = 2 * command.max_range / line.speed_of_sound
    return ping_leaves(line) + travel + command.switch_delay_ms / 1000


@dataclass(frozen=True)
class DriverParameters(MountingParameters, HeadSettings, ConnectionParameters):
    """Parameters of imagenex_852_driver; usable wherever a `HeadSettings` or `ConnectionParameters` is expected."""
