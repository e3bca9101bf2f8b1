"""What the driver counts."""

from dataclasses import dataclass, field
from typing import Dict

from ping360_driver.protocol.sampling import TICK
from ping360_driver.protocol.scan_command import PulseSettings, ScanMode
from sonar_driver.line.driver_health import Problem
from sonar_driver.line.stats import LineStats


@dataclass(frozen=True)
class Ping360Stats(LineStats):
    """Counts since the start, and what the newest beam says of itself.

    `refusals`: commands that the head did not accept. `missing_beams`: directions of a full turn of which no beam came
    while the head scanned by itself; each of them was also a bad frame if its bytes arrived broken.
    """

    refusals: int = 0
    missing_beams: int = 0
    firmware: str = ""
    mode: str = ScanMode.AUTO_TRANSMIT.value
    pulse: PulseSettings = field(default_factory=PulseSettings)

    def details(self) -> Dict[str, str]:
        """Return what else /diagnostics shows: firmware, who turns the head, and the pulse as the head reports it."""
        return {
            "firmware": self.firmware,
            "scan mode": self.mode,
            "gain setting": str(self.pulse.gain_setting),
            "frequency [kHz]": str(self.pulse.transmit_frequency),
            "transmit duration [us]": str(self.pulse.transmit_duration),
            "sample period [us]": f"{1e6 * self.pulse.sample_period * TICK:.3f}",
            "samples": str(self.pulse.number_of_samples),
        }


PROBLEMS = {
    "timeouts": Problem("timeouts", "no reply; check the head's power and the cable"),
    "bad_frames": Problem("bad frames", "a broken message; check the cable, lower baud_rate"),
    "unexpected_replies": Problem("unexpected replies", "a reply came late or twice and was dropped"),
    "refusals": Problem("refusals", "the head did not accept a command"),
    "missing_beams": Problem("missing beams", "the head scanned on, but not every beam arrived"),
}
"""Counts that should stay zero."""
