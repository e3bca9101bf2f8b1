"""The Ping360, as the nodes of drivers and emulated heads know it."""

import threading
from typing import Optional

import rospy

from ping360_driver.emulator import EmulatedPing360, EmulatorParameters
from ping360_driver.line.device import Ping, Ping360Device
from ping360_driver.line.parameters import DriverParameters
from ping360_driver.line.stats import PROBLEMS
from ping360_driver.protocol.scan_command import ScanCommand
from ping360_driver.ros.messages import scan_line
from sonar_driver.emulator import EchoSource, FaultInjector, PtyLine, ServedLine, UdpLine
from sonar_driver.line.port import datagram_address, is_datagram_port
from sonar_driver.ros.driver_node import SonarModel
from sonar_driver.ros.emulator_node import HeadModel
from underwater_map_construction.msg import SonarScanLine


class Ping360(SonarModel):
    """The real head."""

    name = "ping360_driver"
    config_name = "Ping360"
    parameters = DriverParameters
    problems = PROBLEMS

    def device(self, parameters: DriverParameters, stop: threading.Event) -> Ping360Device:
        """Return the head on its line, not yet open."""
        return Ping360Device(parameters, stop, clock=rospy.get_time)

    def command(self, parameters: DriverParameters) -> ScanCommand:
        """Return the command of these settings."""
        return parameters.command()

    def message(self, ping: Ping, parameters: DriverParameters, sensor_angle: float) -> Optional[SonarScanLine]:
        """Return the message of a ping; None if it holds no echoes."""
        if not ping.beam.echoes:
            return None
        mounting = (parameters.frame_id, parameters.inverted, sensor_angle)
        return scan_line(ping.stamp, ping.beam, parameters.speed_of_sound, *mounting)


class EmulatedPing360Model(HeadModel):
    """The emulated head."""

    name = "ping360_emulator"
    config_name = "Ping360Emulator"
    parameters = EmulatorParameters

    def head(self, parameters: EmulatorParameters, source: EchoSource, faults: FaultInjector) -> EmulatedPing360:
        """Return the head."""
        baud_rate = float("inf") if is_datagram_port(parameters.link) else parameters.baud_rate
        return EmulatedPing360(source, faults, baud_rate, parameters.speed_of_sound, parameters.auto_transmit)

    def line(self, parameters: EmulatorParameters) -> ServedLine:
        """Return the line that it is served on, not yet open."""
        if is_datagram_port(parameters.link):
            return UdpLine(*datagram_address(parameters.link))
        return PtyLine(parameters.link)
