"""Writes the default yaml of nodes whose parameters are in groups: the node's own keys, then one group per part."""

from typing import Dict, Type

from node_support.parameter_text import yaml_keys
from node_support.parameters import ParameterSet
from sonar_simulator.gazebo import parameters as gazebo_parameters
from sonar_simulator.gazebo.parameters import GazeboSonarParameters
from sonar_simulator.simulation import simulation_setup
from sonar_simulator.simulation.simulation import SimulatorParameters


def simulator_yaml() -> str:
    """Return the commented defaults of the simulator; all are read only at start-up."""
    return _text("sonar_simulator", SimulatorParameters, simulation_setup.GROUPS)


def gazebo_sonar_yaml() -> str:
    """Return the commented defaults of gazebo_sonar; all are read only at start-up."""
    return _text("gazebo_sonar", GazeboSonarParameters, gazebo_parameters.GROUPS)


def _text(node: str, own: Type[ParameterSet], groups: Dict[str, Type[ParameterSet]]) -> str:
    lines = [f"# Defaults of {node}, read only at start-up.", *yaml_keys(own, live=False)]
    for name, parameters in groups.items():
        lines += ["", f"{name}:"]
        lines += [f"  {line}" if line else "" for line in yaml_keys(parameters, live=False)[1:]]
    return "\n".join(lines) + "\n"
