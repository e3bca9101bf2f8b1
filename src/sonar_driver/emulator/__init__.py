"""What emulated heads of all sonars share: the served line, faults, and where echoes come from."""

from sonar_driver.emulator.echo_source import EchoSource, FixedPattern, PingRequest
from sonar_driver.emulator.emulated_head import EmulatedHead, Transmission
from sonar_driver.emulator.faults import Fault, FaultInjector, FaultRates
from sonar_driver.emulator.head_server import HeadServer, ServedLine
from sonar_driver.emulator.pty_line import PtyLine
from sonar_driver.emulator.udp_line import UdpLine

__all__ = [
    "EchoSource",
    "EmulatedHead",
    "Fault",
    "FaultInjector",
    "FaultRates",
    "FixedPattern",
    "HeadServer",
    "PingRequest",
    "PtyLine",
    "ServedLine",
    "Transmission",
    "UdpLine",
]
