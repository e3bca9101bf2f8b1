"""Steps the sonar's servo through its range, one scan per step (thesis 4.4.2, scenario 1)."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Callable, List, Optional

import numpy as np

from node_support.headers import JUMP_BACK
from node_support.health import Health
from node_support.parameters import ParameterError, parameter
from sonar_processing.beams.head import SweepCounter
from sonar_processing.beams.reader import BeamMessageParameters


class ControlMode(Enum):
    STATIC_MAPPING = "STATIC_MAPPING"
    HORIZONTAL = "HORIZONTAL"


@dataclass(frozen=True)
class SonarControlParameters(BeamMessageParameters):
    mode: ControlMode = parameter(
        ControlMode.STATIC_MAPPING, "STATIC_MAPPING: step through the range; HORIZONTAL: stay at horizontal_deg"
    )
    lowest_deg: float = parameter(-60.0, "first tilt of a sweep", unit="deg", low=-180.0, high=180.0)
    highest_deg: float = parameter(60.0, "last tilt of a sweep before the return", unit="deg", low=-180.0, high=180.0)
    step_deg: float = parameter(5.0, "change of tilt from scan to scan", unit="deg", low=0.1, high=180.0)
    horizontal_deg: float = parameter(0.0, "tilt in HORIZONTAL", unit="deg", low=-180.0, high=180.0)
    tolerance_deg: float = parameter(
        1.0, "largest distance from the goal at which the servo has arrived", unit="deg", low=0.01, high=30.0
    )
    settle_time: float = parameter(0.3, "the servo is still once it rested so long", unit="s", low=0.0, high=60.0)
    move_timeout: float = parameter(10.0, "longest time for a move of the servo", unit="s", low=0.1, high=3600.0)
    joint_timeout: float = parameter(2.0, "longest time between joint states", unit="s", low=0.1, high=3600.0)
    scan_timeout: float = parameter(120.0, "longest time for a scan", unit="s", low=0.1, high=36000.0)
    scan_beams: int = parameter(0, "beams in a scan; 0: a full turn, or both ways through a sector", low=0, high=100000)
    joint: str = parameter("sonar_servo_joint", "name of the servo's joint in /joint_states", tunable=False)

    def check(self) -> None:
        if self.lowest_deg > self.highest_deg:
            raise ParameterError(f"lowest_deg = {self.lowest_deg}: must be at most highest_deg = {self.highest_deg}")

    def goals(self) -> List[float]:
        """Return the tilts of the mode [rad], in order."""
        if self.mode is ControlMode.HORIZONTAL:
            return [math.radians(self.horizontal_deg)]
        steps = math.floor((self.highest_deg - self.lowest_deg) / self.step_deg + 1e-6)
        return [math.radians(self.lowest_deg + step * self.step_deg) for step in range(steps + 1)]


class State(Enum):
    """What is being waited for."""

    TURNING = "waiting until the servo stands still"
    SCANNING = "waiting until the scan is complete"
    HOLDING = "horizontal"


class TiltScan:
    """Decides when the servo moves, from joint angles, beams and time; `command` receives the goals.

    Times are in s, angles in rad.
    """

    def __init__(
        self, parameters: SonarControlParameters, time: float, command: Callable[[float], None], health: Health
    ) -> None:
        self.sweeps = 0
        self._command = command
        self._health = health
        self._angle: Optional[float] = None
        self.restart(parameters, time)

    def restart(self, parameters: SonarControlParameters, time: float) -> None:
        """Begin at the first step, because the parameters changed or time jumped."""
        self.parameters = parameters
        self._goals = parameters.goals()
        self._step, self._direction = 0, 1
        self._joint_time = self._still_since = self._now = time
        self._turn(time)

    @property
    def goal(self) -> float:
        """Where the servo is sent, rad."""
        return self._goals[self._step]

    def take_joint(self, time: float, angle: float) -> None:
        """Note where the servo is, rad; finite."""
        self._see_time(time)
        self._joint_time = time
        if self._angle is None or abs(angle - self._angle) > self._tolerance / 2.0:
            self._angle, self._still_since = angle, time
            if self.state is not State.TURNING:
                self._health.problem(
                    "scans disturbed", f"the servo moved to {math.degrees(angle):.1f} deg without a command"
                )
                self._turn(time)
        arrived = abs(angle - self.goal) <= self._tolerance
        if self.state is State.TURNING and arrived and self._is_still(time):
            self._look(time)

    def take_beam(self, time: float, head_angle: float) -> None:
        """Count a beam; the last one of a scan sends the servo on."""
        self._see_time(time)
        if self.state is State.SCANNING and math.isfinite(head_angle) and self._counter.add(head_angle):
            self._health.count("scans")
            self._go_on(time)

    def tick(self, time: float) -> None:
        """Act on what has not happened by `time` [s]; call it a few times a second."""
        self._see_time(time)
        if time - self._joint_time > self.parameters.joint_timeout:
            self._miss_joint(time)
        elif self.state is State.TURNING and self._angle is not None:
            if time - self._since > self.parameters.move_timeout:
                self._miss_arrival(time)
        elif self.state is State.SCANNING and time - self._since > self.parameters.scan_timeout:
            self._miss_end(time)

    @property
    def _tolerance(self) -> float:
        return math.radians(min(self.parameters.tolerance_deg, self.parameters.step_deg / 2.0))

    def _is_still(self, time: float) -> bool:
        return time - self._still_since >= self.parameters.settle_time

    def _see_time(self, time: float) -> None:
        if self._now == 0.0:
            # A simulated clock begins with a leap; nothing has been missed before.
            self._joint_time = self._since = self._still_since = time
        if time < self._now - JUMP_BACK:
            self._health.problem("jumps back in time", f"by {self._now - time:.1f} s; the sweep begins again")
            self.restart(self.parameters, time)
        self._now = time

    def _turn(self, time: float) -> None:
        self.state, self._since = State.TURNING, time
        self._command(self.goal)

    def _look(self, time: float) -> None:
        is_horizontal = self.parameters.mode is ControlMode.HORIZONTAL
        self.state, self._since = (State.HOLDING if is_horizontal else State.SCANNING), time
        self._counter = SweepCounter(self.parameters.scan_beams)

    def _go_on(self, time: float) -> None:
        if not 0 <= self._step + self._direction < len(self._goals):
            self._direction = -self._direction
            self.sweeps += 1
        self._step = int(np.clip(self._step + self._direction, 0, len(self._goals) - 1))
        self._turn(time)

    def _miss_joint(self, time: float) -> None:
        self._health.problem(
            "waits for joint states",
            f"{self.parameters.joint} not in /joint_states for {time - self._joint_time:.1f} s; check the servo",
        )
        if self.state is not State.TURNING or time - self._since > self.parameters.move_timeout:
            self._turn(time)

    def _miss_arrival(self, time: float) -> None:
        self._health.problem(
            "servo moves not finished",
            f"at {math.degrees(self._angle):.1f} deg instead of {math.degrees(self.goal):.1f} "
            f"after {time - self._since:.1f} s" + ("; scanning there" if self._is_still(time) else ""),
        )
        if self._is_still(time):
            self._look(time)
        else:
            self._turn(time)

    def _miss_end(self, time: float) -> None:
        self._health.problem(
            "scans not finished", f"{self._counter.beams} beams in {time - self._since:.1f} s; check /sonar/raw"
        )
        if self._counter.beams:
            self._go_on(time)
        else:
            self._look(time)
