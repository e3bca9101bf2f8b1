"""Every parameter of the driver: the head's settings, validated before any of them is sent, and the line."""

from dataclasses import dataclass
from typing import Tuple

from node_support.parameters import ParameterError, ParameterSet, parameter
from ping360_driver.scan_command import (
    AHEAD,
    PULSE_US,
    SAMPLES,
    TURN,
    PulseSettings,
    ScanCommand,
    ScanMode,
    gradians,
    longest_pulse_us,
    pulse_us,
    sampling,
)
from sonar_driver.port import LineParameters, MountingParameters


@dataclass(frozen=True)
class HeadSettings(ParameterSet):
    """Every setting of the head; angles are degrees, clockwise, as the head counts them.

    Raises ParameterError for a value out of range and for values that do not fit together.
    """

    max_range: float = parameter(20.0, "range of a beam", unit="m", low=0.75, high=50.0)
    gain_setting: int = parameter(1, "receiver gain: 0 low, 1 normal, 2 high", low=0, high=2)
    frequency_khz: int = parameter(
        750, "frequency; the receiver is made for 650 to 850", unit="kHz", low=500, high=1000
    )
    speed_of_sound: float = parameter(
        1500.0, "speed of sound in the water: turns ranges into times", unit="m/s", low=1300.0, high=1700.0
    )
    train_angle_deg: float = parameter(
        0.0, "centre of the sector, clockwise from ahead, in steps of 0.9", unit="deg", low=-180.0, high=180.0
    )
    sector_width_deg: float = parameter(
        360.0, "width of the sector, in steps of 1.8; 360 turns without end", unit="deg", low=0.0, high=360.0
    )
    step_gradians: int = parameter(1, "turn between pings, in gradians of 0.9 deg", low=1, high=10)
    data_points: int = parameter(600, "most samples per beam; a short range has fewer", low=SAMPLES[0], high=SAMPLES[1])
    transmit_duration_us: int = parameter(
        0, "length of the pulse, from 5; 0: as the range needs it", unit="us", low=0, high=PULSE_US[1]
    )
    scan_mode: ScanMode = parameter(
        ScanMode.AUTO_TRANSMIT,
        "auto_transmit: the head scans by itself, where firmware and sector allow it; request: one request per ping",
    )

    def check(self) -> None:
        super().check()
        if 0 < self.transmit_duration_us < PULSE_US[0]:
            raise ParameterError(
                f"transmit_duration_us = {self.transmit_duration_us}: must be 0, or from {PULSE_US[0]} to "
                f"{PULSE_US[1]} us"
            )
        longest = longest_pulse_us(self._sampling()[1])
        if self.transmit_duration_us > longest:
            raise ParameterError(
                f"transmit_duration_us = {self.transmit_duration_us} with max_range = {self.max_range} and "
                f"data_points = {self.data_points}: the head makes at most {longest} us (64 sample periods)"
            )
        if 0 < self._width() < self.step_gradians:
            raise ParameterError(
                f"sector_width_deg = {self.sector_width_deg}: narrower than step_gradians = {self.step_gradians}"
            )

    def command(self) -> ScanCommand:
        samples, period = self._sampling()
        pulse = PulseSettings(
            gain_setting=self.gain_setting,
            transmit_duration=self.transmit_duration_us or pulse_us(self.max_range, period, self.speed_of_sound),
            sample_period=period,
            transmit_frequency=self.frequency_khz,
            number_of_samples=samples,
        )
        center = (AHEAD + gradians(self.train_angle_deg)) % TURN
        return ScanCommand(pulse, self.scan_mode, center, self._width(), self.step_gradians)

    def _sampling(self) -> Tuple[int, int]:
        return sampling(self.max_range, self.data_points, self.speed_of_sound)

    def _width(self) -> int:
        return 2 * round(gradians(self.sector_width_deg) / 2)


@dataclass(frozen=True)
class DriverParameters(MountingParameters, HeadSettings, LineParameters):
    """Parameters of ping360_driver; usable wherever a `HeadSettings` or `LineParameters` is expected."""

    port: str = parameter("/dev/ttyUSB0", "device, URL (socket://, rfc2217://) or udp://HOST:PORT", tunable=False)
