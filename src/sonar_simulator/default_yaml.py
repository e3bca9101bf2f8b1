"""The text of yaml/sonar_simulator_default.yaml: the simulator's own keys and one group for each of its parts."""

from typing import Dict, Type

from node_support.parameter_text import yaml_keys
from node_support.parameters import ParameterSet
from sonar_simulator.laser_cone import LaserConeParameters
from sonar_simulator.odometry import OdometryParameters
from sonar_simulator.servo import ServoParameters
from sonar_simulator.simulation import SimulatorParameters
from sonar_simulator.sonar_head import SonarParameters

GROUPS: Dict[str, Type[ParameterSet]] = {
    "sonar": SonarParameters,
    "servo": ServoParameters,
    "odometry": OdometryParameters,
    "echo": LaserConeParameters,
}


def simulator_yaml() -> str:
    """Return the commented defaults of the simulator, all read at start-up only."""
    lines = ["# Defaults of sonar_simulator, read when it starts.", *yaml_keys(SimulatorParameters, live=False)]
    for name, parameters in GROUPS.items():
        lines += ["", f"{name}:"]
        lines += [f"  {line}" if line else "" for line in yaml_keys(parameters, live=False)[1:]]
    return "\n".join(lines) + "\n"
