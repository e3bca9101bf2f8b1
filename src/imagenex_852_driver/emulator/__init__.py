"""An emulated Imagenex 852, for use and tests without hardware."""

from imagenex_852_driver.emulator.echo_source import EchoSource, FixedPattern, PingRequest
from imagenex_852_driver.emulator.faults import Fault, FaultInjector, FaultRates
from imagenex_852_driver.emulator.head import EmulatedHead, Transmission
from imagenex_852_driver.emulator.pty_server import PtyServer

__all__ = [
    "EchoSource",
    "EmulatedHead",
    "Fault",
    "FaultInjector",
    "FaultRates",
    "FixedPattern",
    "PingRequest",
    "PtyServer",
    "Transmission",
]
