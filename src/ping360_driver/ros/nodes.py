"""The executables of this package."""

from node_support.ros.node import run
from ping360_driver.ros.model import EmulatedPing360Model, Ping360
from sonar_driver.ros.driver_node import DriverNode
from sonar_driver.ros.emulator_node import EmulatorNode, WorldEchoes


def run_driver() -> None:
    """Run the driver."""
    run(Ping360.name, lambda: DriverNode(Ping360()))


def run_emulator(world_echoes: WorldEchoes) -> None:
    """Run the emulated head; `world_echoes` builds the echoes of the simulator."""
    run(EmulatedPing360Model.name, lambda: EmulatorNode(EmulatedPing360Model(), world_echoes))
