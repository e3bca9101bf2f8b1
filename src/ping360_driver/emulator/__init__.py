"""An emulated Ping360, for use and tests without hardware."""

from ping360_driver.emulator.head import EmulatedPing360
from ping360_driver.emulator.parameters import EmulatorParameters, Ping360FaultRates

__all__ = ["EmulatedPing360", "EmulatorParameters", "Ping360FaultRates"]
