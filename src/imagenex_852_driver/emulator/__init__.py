"""An emulated Imagenex 852, for use and tests without hardware."""

from imagenex_852_driver.emulator.head import Emulated852
from imagenex_852_driver.emulator.parameters import EmulatorParameters, FaultRates852

__all__ = ["Emulated852", "EmulatorParameters", "FaultRates852"]
