"""Simulates world, vehicle and sonar together over time (thesis 6.4), from plain parameter values."""

from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Type, Union

import numpy as np

from node_support.parameters import ParameterSet, parameter
from sonar_simulator.echoes.echo_model import ECHO_MODELS, EchoModelName, make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.commanded_vehicle import CommandedVehicle, VehicleParameters
from sonar_simulator.simulation.odometry import Estimate, NoOdometry, Odometry, OdometryParameters
from sonar_simulator.simulation.robot import RobotDescription, Servo, ServoParameters, tilted
from sonar_simulator.simulation.scripted_vehicle import VehicleScript, VehicleState, load_script
from sonar_simulator.simulation.sonar_head import Sonar, SonarHead, SonarParameters
from sonar_simulator.world.world_file import load_world


class Drive(Enum):
    """What moves the vehicle."""

    SCRIPT = "SCRIPT"
    COMMANDS = "CMD_VEL"


class Head(Enum):
    """What sends the beams."""

    SIMULATED = "SIMULATED"
    EMULATED = "EMULATED"


class Instruments(Enum):
    """What the vehicle navigates with."""

    DVL = "DVL"
    COMPASS = "COMPASS"
    NONE = "NONE"


@dataclass(frozen=True)
class SimulatorParameters(ParameterSet):
    """What is simulated, how fast and from which seed."""

    world: str = parameter("worlds/basin.sdf", "SDF or mesh file; relative to the package's folder", tunable=False)
    script: str = parameter(
        "yaml/basin_tour.yaml", "the vehicle's moves; relative to the package's folder", tunable=False
    )
    echo_model: EchoModelName = parameter(EchoModelName.LASER_CONE, "how contacts become echoes", tunable=False)
    drive: Drive = parameter(
        Drive.SCRIPT,
        "what moves the vehicle: the script, or commands (then the script only gives the start)",
        tunable=False,
    )
    instruments: Instruments = parameter(
        Instruments.DVL,
        "DVL: publishes odometry and its tf; COMPASS: publishes imu and depth instead; NONE: publishes a tf in "
        "which the vehicle stays where it starts",
        tunable=False,
    )
    head: Head = parameter(
        Head.SIMULATED,
        "SIMULATED: the simulator sends beams; EMULATED: an emulated head does, which follows true_sonar, a frame that "
        "tf then knows in the frame world",
        tunable=False,
    )
    seed: int = parameter(
        1, "seed of all random numbers, for the same beams again", low=0, high=2**31 - 1, tunable=False
    )
    real_time_factor: float = parameter(1.0, "simulated seconds per second", low=0.01, high=1000.0, tunable=False)
    clock_rate: float = parameter(20.0, "of /clock, odometry and tf", unit="1/s", low=1.0, high=1000.0, tunable=False)
    wait_for_listener: bool = parameter(True, "SCRIPT: wait until somebody subscribes to the beams", tunable=False)


@dataclass(frozen=True)
class Ping:
    """One beam: head angle [rad] and strengths (bins,) uint8."""

    angle: float
    strengths: np.ndarray


@dataclass(frozen=True)
class Moment:
    """The complete state at one time [s since the start].

    tilt: angle of the sonar's servo, rad. is_tick: whether this is a tick of the steady rate. head_angle: direction of
    the head, rad, if it sends a beam now; `ping` is that beam once it has been simulated.
    """

    time: float
    truth: VehicleState
    odometry: Estimate
    tilt: float
    is_tick: bool = True
    head_angle: Optional[float] = None
    ping: Optional[Ping] = None


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


class Simulation:
    """Runs once, forwards. Ticks come at a steady rate, pings when the head sends them.

    `T_base_sonar` (4, 4) is the sonar's mount with its servo at 0, `T_world_start` (4, 4) where the vehicle starts.
    `commanded` is the vehicle that follows velocity commands; where the script drives, it is not used.
    """

    def __init__(self, settings: Settings, folder: Path, robot: RobotDescription, warn: Callable[[str], None]) -> None:
        """Load world and script, relative to `folder`, and put everything together.

        `warn` receives a line for each part of the world that could not be loaded. Raises ParameterError.
        """
        parameters = settings.simulator
        model = make_echo_model(parameters.echo_model.value, settings.echo.to_mapping())
        script = load_script(folder / Path(parameters.script).expanduser())
        self.T_base_sonar = robot.mount(BASE_FRAME, SONAR_FRAME)
        self.world = load_world(folder / Path(parameters.world).expanduser())
        for warning in self.world.warnings:
            warn(warning)
        # Separate streams, so that a change of the odometry's noise does not change the beams.
        beams, measurements = (np.random.default_rng(s) for s in np.random.SeedSequence(parameters.seed).spawn(2))
        self.sonar = Sonar(RayCaster(self.world), settings.sonar.pattern(), model, beams)
        self.servo = Servo(settings.servo)
        self.commanded = CommandedVehicle(settings.vehicle, script.start)
        self.T_world_start = script.pose(0.0)
        is_scripted = parameters.drive is Drive.SCRIPT
        self._movement: Union[VehicleScript, CommandedVehicle] = script if is_scripted else self.commanded
        self._tilt_commands = list(script.tilt_commands) if is_scripted else []
        self.duration = self._movement.duration
        self._odometry: Union[Odometry, NoOdometry] = NoOdometry(self.T_world_start)
        if parameters.instruments is not Instruments.NONE:
            self._odometry = Odometry(settings.odometry, self.T_world_start, measurements)
        self._head: Optional[SonarHead] = None
        if parameters.head is Head.SIMULATED:
            self._head = SonarHead(settings.sonar.beams_per_turn, settings.sonar.seconds_per_turn)

    def moments(self, tick_rate: float, beams_at_once: int = 1) -> Iterator[Moment]:
        """Yield all moments from time 0 to the end of the motion, in order of time.

        With `beams_at_once` > 1, moments are held back until that many beams can be cast together. This is faster, and
        draws random numbers in a different order.
        """
        waiting: List[Moment] = []
        beams = 0
        for moment in self._unheard(tick_rate):
            waiting.append(moment)
            beams += int(moment.head_angle is not None)
            if beams in (0, beams_at_once):
                yield from self._heard(waiting)
                waiting, beams = [], 0
        yield from self._heard(waiting)

    def moment(self, time: float, is_tick: bool = True, head_angle: Optional[float] = None) -> Moment:
        """Return the state at `time`, not before that of the last call, with a beam still to be simulated."""
        self._command_tilt(time)
        truth = self._movement.state(time)
        return Moment(time, truth, self._odometry.estimate(time, truth), self.servo.angle(time), is_tick, head_angle)

    def sonar_pose(self, moment: Moment) -> np.ndarray:
        """Return the (4, 4) T_world_sonar that the sonar truly has at a moment."""
        return moment.truth.T_world_base @ tilted(self.T_base_sonar, moment.tilt)

    def _unheard(self, tick_rate: float) -> Iterator[Moment]:
        tick, beam = 0, 0
        while True:
            tick_time, beam_time = tick / tick_rate, np.inf if self._head is None else self._head.time(beam)
            if min(tick_time, beam_time) > self.duration:
                return
            if beam_time <= tick_time:
                both = beam_time == tick_time
                yield self.moment(beam_time, both, self._head.angle(beam))
                beam += 1
                tick += int(both)
            else:
                yield self.moment(tick_time)
                tick += 1

    def _heard(self, moments: List[Moment]) -> List[Moment]:
        sending = [moment for moment in moments if moment.head_angle is not None]
        if not sending:
            return moments
        poses = np.array([self.sonar_pose(moment) for moment in sending])
        beams = iter(self.sonar.pings(poses, np.array([moment.head_angle for moment in sending])))
        return [
            moment if moment.head_angle is None else replace(moment, ping=Ping(moment.head_angle, next(beams)))
            for moment in moments
        ]

    def _command_tilt(self, time: float) -> None:
        while self._tilt_commands and self._tilt_commands[0].time <= time:
            command = self._tilt_commands.pop(0)
            self.servo.angle(command.time)
            self.servo.command(command.angle)
