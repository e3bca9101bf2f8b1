"""The executables of this package."""

from node_support.ros.node import DiagnosticsPublisher, run
from sonar_simulator.ros.gazebo_node import GazeboSonar
from sonar_simulator.ros.simulator_node import Simulator


def run_simulator() -> None:
    """Run the simulator."""

    def construct() -> tuple:
        simulator = Simulator()
        return simulator, DiagnosticsPublisher([simulator.health])

    run("sonar_simulator", construct)


def run_gazebo_sonar() -> None:
    """Run gazebo_sonar."""

    def construct() -> tuple:
        sonar = GazeboSonar()
        return sonar, DiagnosticsPublisher([sonar.health])

    run("gazebo_sonar", construct)
