"""The nodes of the Imagenex 852: its driver and its emulated head."""

from typing import Optional

from imagenex_852_driver.device import Ping, SonarDevice
from imagenex_852_driver.emulated_852 import Emulated852, EmulatorParameters
from imagenex_852_driver.parameters import DriverParameters
from imagenex_852_driver.reply import Reply, head_angle
from node_support.ros.node import run
from sonar_driver.head_server import PtyLine
from sonar_driver.ros.nodes import DriverNode, EmulatorNode, WorldEchoes, scan_line
from underwater_map_construction.msg import SonarScanLine


def run_driver() -> None:
    name = "imagenex_852_driver"
    run(name, lambda: DriverNode(name, DriverParameters, SonarDevice, _message))


def run_emulator(world_echoes: WorldEchoes) -> None:
    name = "imagenex_852_emulator"
    run(name, lambda: EmulatorNode(name, EmulatorParameters, Emulated852, PtyLine, world_echoes))


def reply_message(reply: Reply, gain_db: int, inverted: bool) -> Optional[SonarScanLine]:
    """Return the message of a reply, without header and sensorAngle; None if it holds no echoes."""
    return scan_line(head_angle(reply.head_position, inverted), reply.echoes, reply.range_resolution, gain_db)


def _message(ping: Ping, parameters: DriverParameters) -> Optional[SonarScanLine]:
    return reply_message(ping.reply, ping.command.start_gain_db, parameters.inverted)
