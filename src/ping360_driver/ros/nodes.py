"""The nodes of the Ping360: its driver and its emulated head."""

from typing import Optional

from node_support.ros.node import run
from ping360_driver.device import Ping, Ping360Device
from ping360_driver.emulated_ping360 import EmulatedPing360, EmulatorParameters
from ping360_driver.parameters import DriverParameters
from ping360_driver.scan_command import bin_length, head_angle
from sonar_driver.head_server import PtyLine, ServedLine, UdpLine
from sonar_driver.port import datagram_address, is_datagram_port
from sonar_driver.ros.nodes import DriverNode, EmulatorNode, WorldEchoes, scan_line
from underwater_map_construction.msg import SonarScanLine


def run_driver() -> None:
    name = "ping360_driver"
    run(name, lambda: DriverNode(name, DriverParameters, Ping360Device, _message))


def run_emulator(world_echoes: WorldEchoes) -> None:
    name = "ping360_emulator"
    run(name, lambda: EmulatorNode(name, EmulatorParameters, EmulatedPing360, _line, world_echoes))


def _message(ping: Ping, parameters: DriverParameters) -> Optional[SonarScanLine]:
    """Return the message of a ping; its range is what the head's own sample period makes of it."""
    pulse, angle = ping.beam.pulse, head_angle(ping.beam.angle, parameters.inverted)
    resolution = bin_length(pulse.sample_period, parameters.speed_of_sound)
    return scan_line(angle, ping.beam.echoes, resolution, pulse.gain_setting)


def _line(link: str) -> ServedLine:
    return UdpLine(*datagram_address(link)) if is_datagram_port(link) else PtyLine(link)
