"""The Imagenex 852, as the nodes of drivers and emulated heads know it."""

import threading
from typing import Optional

import rospy

from imagenex_852_driver.emulator import Emulated852, EmulatorParameters
from imagenex_852_driver.line.device import Ping, SonarDevice
from imagenex_852_driver.line.parameters import DriverParameters
from imagenex_852_driver.line.stats import PROBLEMS
from imagenex_852_driver.protocol import SwitchCommand
from imagenex_852_driver.ros.messages import scan_line
from sonar_driver.emulator import EchoSource, FaultInjector, PtyLine, ServedLine
from sonar_driver.ros.driver_node import SonarModel
from sonar_driver.ros.emulator_node import HeadModel
from underwater_map_construction.msg import SonarScanLine


class Imagenex852(SonarModel):
    """The real head."""

    name = "imagenex_852_driver"
    config_name = "Imagenex852"
    parameters = DriverParameters
    problems = PROBLEMS

    def device(self, parameters: DriverParameters, stop: threading.Event) -> SonarDevice:
        """Return the head on its line, not yet open."""
        return SonarDevice(parameters, stop, clock=rospy.get_time)

    def command(self, parameters: DriverParameters) -> SwitchCommand:
        """Return the command of these settings."""
        return parameters.command()

    def message(self, ping: Ping, parameters: DriverParameters, sensor_angle: float) -> Optional[SonarScanLine]:
        """Return the message of a ping; None if it holds no echoes."""
        gain_db = ping.command.start_gain_db
        return scan_line(ping.stamp, ping.reply, gain_db, parameters.frame_id, parameters.inverted, sensor_angle)


class EmulatedImagenex852(HeadModel):
    """The emulated head."""

    name = "imagenex_852_emulator"
    config_name = "Imagenex852Emulator"
    parameters = EmulatorParameters

    def head(self, parameters: EmulatorParameters, source: EchoSource, faults: FaultInjector) -> Emulated852:
        """Return the head."""
        return Emulated852(source, faults, parameters.timing(), parameters.head_id)

    def line(self, parameters: EmulatorParameters) -> ServedLine:
        """Return the line that it is served on, not yet open."""
        return PtyLine(parameters.link)
