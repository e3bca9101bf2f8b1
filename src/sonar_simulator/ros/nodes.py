"""The executables of this package."""

from node_support.ros.node import run
from sonar_simulator.ros.gazebo_node import GazeboSonar
from sonar_simulator.ros.simulator_node import Simulator


def run_simulator() -> None:
    """Run the simulator."""
    run("sonar_simulator", Simulator)


def run_gazebo_sonar() -> None:
    """Run gazebo_sonar."""
    run("gazebo_sonar", GazeboSonar)
