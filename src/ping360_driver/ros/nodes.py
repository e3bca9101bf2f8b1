"""The nodes of the Ping360: its driver and its emulated head."""

from typing import Optional

from node_support.ros.node import run
from ping360_driver.device import Ping, Ping360Device
from ping360_driver.emulated_ping360 import EmulatedPing360, EmulatorParameters
from ping360_driver.parameters import DriverParameters
from ping360_driver.scan_command import bin_length, head_angle
from sonar_driver.emulated_head import EchoSource, FaultInjector
from sonar_driver.head_server import PtyLine, ServedLine, UdpLine
from sonar_driver.port import datagram_address, is_datagram_port
from sonar_driver.ros.nodes import DriverNode, EmulatorNode, HeadModel, SonarModel, WorldEchoes, scan_line
from underwater_map_construction.msg import SonarScanLine


def run_driver() -> None:
    model = SonarModel("ping360_driver", DriverParameters, Ping360Device, _message)
    run(model.name, lambda: DriverNode(model))


def run_emulator(world_echoes: WorldEchoes) -> None:
    model = HeadModel("ping360_emulator", EmulatorParameters, _head, _line)
    run(model.name, lambda: EmulatorNode(model, world_echoes))


def _message(ping: Ping, parameters: DriverParameters) -> Optional[SonarScanLine]:
    """Return the message of a ping; its range is what the head's own sample period makes of it."""
    pulse, angle = ping.beam.pulse, head_angle(ping.beam.angle, parameters.inverted)
    resolution = bin_length(pulse.sample_period, parameters.speed_of_sound)
    return scan_line(angle, ping.beam.echoes, resolution, pulse.gain_setting)


def _head(parameters: EmulatorParameters, source: EchoSource, faults: FaultInjector) -> EmulatedPing360:
    baud_rate = float("inf") if is_datagram_port(parameters.link) else parameters.baud_rate
    return EmulatedPing360(source, faults, baud_rate, parameters.speed_of_sound, parameters.auto_transmit)


def _line(parameters: EmulatorParameters) -> ServedLine:
    if is_datagram_port(parameters.link):
        return UdpLine(*datagram_address(parameters.link))
    return PtyLine(parameters.link)
