"""World, vehicle and sonar together on one time line (thesis 6.4). Free of ROS."""

from dataclasses import dataclass
from typing import Iterator, Optional

import numpy as np

from node_support.parameters import ParameterSet, parameter
from sonar_simulator.odometry import Odometry
from sonar_simulator.servo import Servo, ServoParameters, tilted
from sonar_simulator.sonar_head import Sonar, SonarHead
from sonar_simulator.vehicle import VehicleScript


@dataclass(frozen=True)
class SimulatorParameters(ParameterSet):
    """What is simulated, how fast and from which seed."""

    world: str = parameter("worlds/basin.sdf", "SDF file; relative to the package's folder", tunable=False)
    script: str = parameter(
        "yaml/basin_tour.yaml", "moves of the vehicle; relative to the package's folder", tunable=False
    )
    echo_model: str = parameter("laser_cone", "how ray distances become echoes", tunable=False)
    seed: int = parameter(1, "of all random numbers: same seed, same beams", low=0, high=2**31 - 1, tunable=False)
    real_time_factor: float = parameter(
        1.0, "simulated seconds per second of wall time", low=0.01, high=1000.0, tunable=False
    )
    clock_rate: float = parameter(
        20.0, "ticks of /clock, odometry and tf", unit="1/s", low=1.0, high=1000.0, tunable=False
    )
    wait_for_listener: bool = parameter(True, "begin when somebody subscribes to the beams", tunable=False)


@dataclass(frozen=True)
class Ping:
    """One beam: head angle [rad] and strengths (bins,) uint8."""

    angle: float
    strengths: np.ndarray


@dataclass(frozen=True)
class Moment:
    """The state at one time [s since the start]. T_* are (4, 4); twist is (6,) in the body frame by odometry.

    tilt: angle of the sonar's servo, rad.
    """

    time: float
    T_world_base: np.ndarray
    T_odom_base: np.ndarray
    twist: np.ndarray
    ping: Optional[Ping]
    tilt: float = 0.0


class Simulation:
    """Runs a script once. Ticks come at a steady rate, pings when the head sends them."""

    def __init__(
        self,
        script: VehicleScript,
        odometry: Odometry,
        sonar: Sonar,
        head: SonarHead,
        T_base_sonar: np.ndarray,
        servo: Optional[Servo] = None,
    ) -> None:
        """`T_base_sonar` (4, 4) is the sonar's mount with its servo at 0; without `servo` it stays there."""
        self.duration = script.duration
        self._script = script
        self._odometry = odometry
        self._sonar = sonar
        self._head = head
        self._T_base_sonar = T_base_sonar
        self._servo = servo or Servo(ServoParameters())

    def moments(self, tick_rate: float) -> Iterator[Moment]:
        """Yield all moments from time 0 to the end of the script, in order of time."""
        tick, beam = 0, 0
        while True:
            tick_time, beam_time = tick / tick_rate, self._head.time(beam)
            if min(tick_time, beam_time) > self.duration:
                return
            if beam_time <= tick_time:
                yield self.moment(beam_time, self._head.angle(beam))
                beam += 1
                tick += int(beam_time == tick_time)
            else:
                yield self.moment(tick_time)
                tick += 1

    def moment(self, time: float, head_angle: Optional[float] = None) -> Moment:
        """Return the state at `time`, with a ping if the head sends one at `head_angle`."""
        T_world_base = self._script.pose(time)
        still = self._script.is_still(time)
        twist = np.zeros(6) if still else self._odometry.twist(self._script.twist(time))
        tilt = self._servo.angle(time)
        ping = None
        if head_angle is not None:
            T_world_sonar = T_world_base @ tilted(self._T_base_sonar, tilt)
            ping = Ping(head_angle, self._sonar.ping(T_world_sonar, head_angle))
        return Moment(time, T_world_base, self._odometry.pose(T_world_base), twist, ping, tilt)
