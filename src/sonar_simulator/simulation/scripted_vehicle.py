"""A vehicle that follows a script, and the files of scripts."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, List, Mapping, NamedTuple, Sequence, Type, Union

import numpy as np

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError, ParameterSet, parameter, read_values


@dataclass(frozen=True)
class VehicleState:
    """The vehicle's true pose and velocity.

    T_world_base: (4, 4). twist: (6,) in the body frame, linear x y z m/s, angular x y z rad/s. is_still: at rest.
    """

    T_world_base: np.ndarray
    twist: np.ndarray
    is_still: bool


# Peak speed over mean speed of the minimum-jerk law: its greatest slope, reached half way.
_PEAK = 1.875
# Beyond all coordinates of worlds: farther away, computing with the world's places overflows.
_PLACE = {"unit": "m", "low": -1e8, "high": 1e8}


@dataclass(frozen=True)
class Start(ParameterSet):
    """The start pose of a script, in the world frame."""

    x: float = parameter(0.0, "start", **_PLACE)
    y: float = parameter(0.0, "start", **_PLACE)
    z: float = parameter(-2.0, "start, 0 at the water's surface", **_PLACE)
    yaw_deg: float = parameter(0.0, "heading, counter-clockwise from +x", unit="deg")

    def pose(self) -> np.ndarray:
        """Return x, y, z [m] and yaw [rad]."""
        return np.array([self.x, self.y, self.z, math.radians(self.yaw_deg)])


@dataclass(frozen=True)
class Entry(ParameterSet):
    """One entry of a script."""

    def displacement(self) -> np.ndarray:
        """Return the displacement x, y, z [m] and yaw [rad]."""
        return np.zeros(4)

    def duration(self) -> float:
        """Return the time that it takes, s."""
        return 0.0


@dataclass(frozen=True)
class Move(Entry):
    """A displacement along the axes of the world, with a turn, beginning and ending at rest."""

    x: float = parameter(0.0, "displacement", **_PLACE)
    y: float = parameter(0.0, "displacement", **_PLACE)
    z: float = parameter(0.0, "displacement, up positive", **_PLACE)
    yaw_deg: float = parameter(0.0, "turn, counter-clockwise positive", unit="deg")
    speed: float = parameter(1.0, "greatest speed during the move", unit="m/s", low=0.001)
    turn_rate_deg: float = parameter(15.0, "greatest turn rate during the move", unit="deg/s", low=0.001)
    seconds: float = parameter(0.0, "duration of the move; 0: determined by speed and turn rate", unit="s", low=0.0)

    def check(self) -> None:
        if not self.displacement().any():
            raise ParameterError("x, y, z, yaw_deg are all 0: one must differ; to stay use wait")

    def displacement(self) -> np.ndarray:
        return np.array([self.x, self.y, self.z, math.radians(self.yaw_deg)])

    def duration(self) -> float:
        distance = math.sqrt(self.x**2 + self.y**2 + self.z**2)
        return self.seconds or _PEAK * max(distance / self.speed, abs(self.yaw_deg) / self.turn_rate_deg)


@dataclass(frozen=True)
class Wait(Entry):
    """Waiting."""

    wait: float = parameter(0.0, "time to stay", unit="s", low=0.0)

    def duration(self) -> float:
        return self.wait


@dataclass(frozen=True)
class Tilt(Entry):
    """The sonar's servo starts to turn, and the script continues at once."""

    tilt_deg: float = parameter(0.0, "angle of the servo, positive down", unit="deg", low=-180.0, high=180.0)


class TiltCommand(NamedTuple):
    """A command to the servo: when, s since the script's start, and to which angle, rad."""

    time: float
    angle: float


class VehicleScript:
    """Moves one after the other; each follows the minimum-jerk law, so the twist is continuous.

    `start` is (4,) x, y, z [m], yaw [rad]; `tilt_commands` are in order of time. Before time 0 the vehicle is at
    its start pose, after `duration` where the last move ended.
    """

    def __init__(self, entries: Sequence[Any], start: np.ndarray) -> None:
        self._displacements = np.array([entry.displacement() for entry in entries]).reshape(-1, 4)
        self._durations = np.array([entry.duration() for entry in entries], dtype=np.float64)
        self._ends = np.cumsum(self._durations)
        self._origins = np.vstack([start, start + np.cumsum(self._displacements, axis=0)])
        self.start = np.array(start, dtype=np.float64)
        self.tilt_commands: List[TiltCommand] = [
            TiltCommand(float(end), math.radians(entry.tilt_deg))
            for entry, end in zip(entries, self._ends)
            if isinstance(entry, Tilt)
        ]

    @classmethod
    def from_yaml_data(cls, moves: Any, start: Any = None) -> "VehicleScript":
        """Build from a list of mappings, keys as in `Move`, `Wait` or `Tilt`, and a mapping with keys as in `Start`.

        Raises ParameterError.
        """
        if not isinstance(moves, list) or not moves:
            raise ParameterError(f"moves = {moves!r}: must be a list with at least one entry")
        beginning = Start.from_group("start", {} if start is None else start)
        entries = [_kind_of(values).from_group(f"entry {number}", values) for number, values in enumerate(moves, 1)]
        return cls(entries, beginning.pose())

    @property
    def duration(self) -> float:
        """Time from the first move's start to the last one's end, s."""
        return float(self._ends[-1])

    def pose(self, time: float) -> np.ndarray:
        """Return the (4, 4) T_world_base at `time` [s]; x forward, y left, z up."""
        return self.state(time).T_world_base

    def state(self, time: float) -> VehicleState:
        """Return the vehicle's state at `time` s, in any order of times."""
        index = int(np.searchsorted(self._ends, time, side="right"))
        if time < 0.0 or index == len(self._ends):
            position, velocity, is_still = self._origins[0 if time < 0.0 else -1], np.zeros(4), True
        else:
            duration, displacement = self._durations[index], self._displacements[index]
            u = (time - (self._ends[index] - duration)) / duration
            travelled = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
            slope = 30.0 * u**2 * (1.0 - u) ** 2 / duration
            position, velocity = self._origins[index] + travelled * displacement, slope * displacement
            is_still = not displacement.any()
        x, y, z, yaw = position.tolist()
        along_x, along_y, up, turn = velocity.tolist()
        cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
        surge, sway = cos_yaw * along_x + sin_yaw * along_y, cos_yaw * along_y - sin_yaw * along_x
        twist = np.array([surge, sway, up, 0.0, 0.0, turn])
        return VehicleState(pose_matrix((x, y, z), (0.0, 0.0, yaw)), twist, is_still)


def _kind_of(values: Any) -> Type[Entry]:
    keys = values if isinstance(values, Mapping) else ()
    return Wait if "wait" in keys else Tilt if "tilt_deg" in keys else Move


_KEYS = ("start", "moves")


def load_script(path: Union[str, Path]) -> VehicleScript:
    """Return the script in a file. Raises ParameterError, naming the file, if it cannot be read or followed."""
    data = read_values(Path(path))
    if set(data) - set(_KEYS):
        raise ParameterError(f"{path}: must hold the keys {' and '.join(_KEYS)} and no others")
    try:
        return VehicleScript.from_yaml_data(data.get("moves"), data.get("start"))
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from error
