"""The executables of this package."""

import sys

import rospy
from rosgraph.names import anonymous_name

from imagenex_852_driver.logs.arguments import convert_arguments, play_arguments, record_arguments
from imagenex_852_driver.ros.log_tools import LogPlayer, LogRecorder, convert
from imagenex_852_driver.ros.model import EmulatedImagenex852, Imagenex852
from node_support.ros.node import StartError, run
from sonar_driver.ros.driver_node import DriverNode
from sonar_driver.ros.emulator_node import EmulatorNode, WorldEchoes


def run_driver() -> None:
    """Run the driver."""
    run(Imagenex852.name, lambda: DriverNode(Imagenex852()))


def run_emulator(world_echoes: WorldEchoes) -> None:
    """Run the emulated head; `world_echoes` builds the echoes of the simulator."""
    run(EmulatedImagenex852.name, lambda: EmulatorNode(EmulatedImagenex852(), world_echoes))


def run_player() -> None:
    """Publish a log, then end; several may play at once."""
    options = play_arguments(rospy.myargv()[1:])
    run(anonymous_name("play_852"), lambda: LogPlayer(options))


def run_recorder() -> None:
    """Record a log until Ctrl-C."""
    options = record_arguments(rospy.myargv()[1:])
    run("record_852", lambda: LogRecorder(options))


def run_converter() -> None:
    """Convert a log to a bag; needs no ROS master."""
    try:
        print(f"convert_852: {convert(convert_arguments(sys.argv[1:]))}")
    except StartError as error:
        sys.exit(f"convert_852: {error}")
