"""The nodes of the Imagenex 852: its driver and its emulated head."""

from typing import Optional

from imagenex_852_driver.device import Ping, SonarDevice
from imagenex_852_driver.emulated_852 import Emulated852, EmulatorParameters
from imagenex_852_driver.parameters import DriverParameters, LineTiming
from imagenex_852_driver.reply import Reply, head_angle
from node_support.ros.node import run
from sonar_driver.emulated_head import EchoSource, FaultInjector
from sonar_driver.head_server import PtyLine
from sonar_driver.ros.nodes import DriverNode, EmulatorNode, HeadModel, SonarModel, WorldEchoes, scan_line
from underwater_map_construction.msg import SonarScanLine


def run_driver() -> None:
    model = SonarModel("imagenex_852_driver", DriverParameters, SonarDevice, _message)
    run(model.name, lambda: DriverNode(model))


def run_emulator(world_echoes: WorldEchoes) -> None:
    model = HeadModel("imagenex_852_emulator", EmulatorParameters, _head, lambda parameters: PtyLine(parameters.link))
    run(model.name, lambda: EmulatorNode(model, world_echoes))


def reply_message(reply: Reply, gain_db: int, inverted: bool) -> Optional[SonarScanLine]:
    """Return the message of a reply, without header and sensorAngle; None if it holds no echoes."""
    return scan_line(head_angle(reply.head_position, inverted), reply.echoes, reply.range_resolution, gain_db)


def _message(ping: Ping, parameters: DriverParameters) -> Optional[SonarScanLine]:
    return reply_message(ping.reply, ping.command.start_gain_db, parameters.inverted)


def _head(parameters: EmulatorParameters, source: EchoSource, faults: FaultInjector) -> Emulated852:
    timing = LineTiming(parameters.baud_rate, parameters.speed_of_sound)
    return Emulated852(source, faults, timing, parameters.head_id)
