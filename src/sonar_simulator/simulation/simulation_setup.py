"""Makes a simulation from plain parameter values, for the node and for bags."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Dict, Mapping, Optional, Type, Union

import numpy as np

from node_support.parameters import ParameterError, ParameterSet
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.simulation import Drive, Head, Instruments, Simulation, SimulatorParameters
from sonar_simulator.simulation.sonar_head import Sonar, SonarHead, SonarParameters
from sonar_simulator.vehicle.commanded_vehicle import CommandedVehicle, VehicleParameters
from sonar_simulator.vehicle.odometry import NoOdometry, Odometry, OdometryParameters
from sonar_simulator.vehicle.robot import DescriptionError, RobotDescription, Servo, ServoParameters
from sonar_simulator.vehicle.scripted_vehicle import ScriptError, load_script
from sonar_simulator.world.world import World, WorldError
from sonar_simulator.world.world_file import load_world

BASE_FRAME = "base_link"
SONAR_FRAME = "sonar"

GROUPS: Dict[str, Type[ParameterSet]] = {
    "sonar": SonarParameters,
    "servo": ServoParameters,
    "vehicle": VehicleParameters,
    "odometry": OdometryParameters,
    **{name: kind.parameters for name, kind in ECHO_MODELS.items()},
}
"""Groups of parameters; of the echo models' groups, the one that `echo_model` names is used."""


@dataclass(frozen=True)
class Settings:
    """All parameters of a simulation, validated; `echo` holds those of the selected echo model."""

    simulator: SimulatorParameters
    sonar: SonarParameters
    servo: ServoParameters
    vehicle: VehicleParameters
    odometry: OdometryParameters
    echo: ParameterSet

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> "Settings":
        """Build from the simulator's own keys and one mapping for each group; raises ParameterError."""
        own = dict(values)
        groups = {name: kind.from_group(name, own.pop(name, {})) for name, kind in GROUPS.items()}
        simulator = SimulatorParameters.from_mapping(own)
        echo = groups[simulator.echo_model.value]
        parts = {name: group for name, group in groups.items() if name not in ECHO_MODELS}
        return cls(simulator=simulator, echo=echo, **parts)

    def to_mapping(self) -> Dict[str, Any]:
        """Return plain values, as `from_mapping` takes them; with only the selected echo model."""
        groups = {name: getattr(self, name) for name in GROUPS if name not in ECHO_MODELS}
        groups[self.simulator.echo_model.value] = self.echo
        return {**self.simulator.to_mapping(), **{name: group.to_mapping() for name, group in groups.items()}}


@dataclass(frozen=True)
class Setup:
    """A simulation, and those of its parts that others use. T_world_start: (4, 4), of the vehicle."""

    simulation: Simulation
    world: World
    sonar: Sonar
    servo: Servo
    commanded: CommandedVehicle
    T_base_sonar: np.ndarray
    T_world_start: np.ndarray


def make_setup(settings: Settings, folder: Path, robot: RobotDescription, warn: Callable[[str], None]) -> Setup:
    """Load world and script, relative to `folder`, and put everything together.

    `warn` receives a line for each part of the world that could not be loaded. Raises ParameterError.
    """
    parameters = settings.simulator
    model = make_echo_model(parameters.echo_model.value, settings.echo.to_mapping())
    script = _loaded(lambda: load_script(folder / Path(parameters.script).expanduser()))
    T_base_sonar = _loaded(lambda: robot.mount(BASE_FRAME, SONAR_FRAME))
    world = _loaded(lambda: _load_world(folder / Path(parameters.world).expanduser(), warn))
    # Separate streams, so that a change of the odometry's noise does not change the beams.
    beams, measurements = (np.random.default_rng(s) for s in np.random.SeedSequence(parameters.seed).spawn(2))
    sonar = Sonar(_loaded(lambda: RayCaster(world)), settings.sonar.pattern(), model, beams)
    servo = Servo(settings.servo)
    commanded = CommandedVehicle(settings.vehicle, script.start)
    is_scripted = parameters.drive is Drive.SCRIPT
    simulation = Simulation(
        script if is_scripted else commanded, _odometry(settings, script.pose(0.0), measurements), sonar,
        _head(settings), T_base_sonar, servo, script.tilt_commands if is_scripted else (),
    )  # fmt: skip
    return Setup(simulation, world, sonar, servo, commanded, T_base_sonar, script.pose(0.0))


def _head(settings: Settings) -> Optional[SonarHead]:
    if settings.simulator.head is Head.EMULATED:
        return None
    return SonarHead(settings.sonar.beams_per_turn, settings.sonar.seconds_per_turn)


def _odometry(settings: Settings, start: np.ndarray, rng: np.random.Generator) -> Union[Odometry, NoOdometry]:
    if settings.simulator.instruments is Instruments.NONE:
        return NoOdometry(start)
    return Odometry(settings.odometry, start, rng)


def _load_world(path: Path, warn: Callable[[str], None]) -> World:
    loaded = load_world(path)
    for warning in loaded.warnings:
        warn(warning)
    return loaded.world


def _loaded(load: Callable[[], Any]) -> Any:
    try:
        return load()
    except (WorldError, ScriptError, DescriptionError) as error:
        raise ParameterError(str(error)) from error
