"""Where the sonar is mounted on the robot, from its URDF, and the servo that tilts it."""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Tuple

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError, ParameterSet, parameter


@dataclass(frozen=True)
class Joint:
    """A joint at its zero position: T_parent_child is (4, 4)."""

    parent: str
    child: str
    is_fixed: bool
    T_parent_child: np.ndarray


class RobotDescription:
    """The joints of a URDF."""

    def __init__(self, urdf: str) -> None:
        """Raises ParameterError if the text is not a URDF."""
        try:
            root = ET.fromstring(urdf)
        except ET.ParseError as error:
            raise ParameterError(f"robot_description: not XML: {error}") from error
        self._joints: Dict[str, Joint] = {}
        for element in root.findall("joint"):
            joint = _joint(element)
            self._joints[joint.child] = joint

    @classmethod
    def from_file(cls, path: Path) -> "RobotDescription":
        """Read a URDF file; raises ParameterError."""
        try:
            return cls(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise ParameterError(f"{path}: {getattr(error, 'strerror', None) or 'not a text'}") from error

    @property
    def fixed_joints(self) -> List[Joint]:
        return [joint for joint in self._joints.values() if joint.is_fixed]

    def mount(self, base: str, link: str) -> np.ndarray:
        """Return the (4, 4) T_base_link with every joint at zero; raises ParameterError if no joints lead there."""
        pose, child = np.eye(4), link
        for _ in range(len(self._joints) + 1):
            if child == base:
                return pose
            if child not in self._joints:
                break
            pose = self._joints[child].T_parent_child @ pose
            child = self._joints[child].parent
        raise ParameterError(f"robot_description: no joints lead from {base} to {link}")


def _joint(element: ET.Element) -> Joint:
    name = element.get("name", "?")
    parent, child, origin = element.find("parent"), element.find("child"), element.find("origin")
    if parent is None or child is None:
        raise ParameterError(f"robot_description: joint {name} has no parent or no child")
    attributes = {} if origin is None else origin.attrib
    pose = pose_matrix(_numbers(attributes, "xyz", name), _numbers(attributes, "rpy", name))
    return Joint(parent.get("link", ""), child.get("link", ""), element.get("type") == "fixed", pose)


def _numbers(attributes: Dict[str, str], key: str, joint: str) -> Tuple[float, ...]:
    text = attributes.get(key, "0 0 0")
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != 3 or not np.isfinite(values).all():
        raise ParameterError(f"robot_description: joint {joint}: {key} = {text!r}: must be three numbers")
    return values


@dataclass(frozen=True)
class ServoParameters(ParameterSet):
    """Speed and range of the servo."""

    speed_deg: float = parameter(60.0, "speed of the servo", unit="deg/s", low=0.001, high=10000.0, tunable=False)
    lowest_deg: float = parameter(
        -90.0, "end of its range, with the sonar looking up", unit="deg", low=-180.0, high=0.0, tunable=False
    )
    highest_deg: float = parameter(
        90.0, "end of its range, with the sonar looking down", unit="deg", low=0.0, high=180.0, tunable=False
    )

    def check(self) -> None:
        if self.lowest_deg == self.highest_deg:
            raise ParameterError(f"lowest_deg = {self.lowest_deg}: must be below highest_deg = {self.highest_deg}")


class Servo:
    """Stays at 0 until the first command. Angles are rad about the sonar's +y: positive tilts its +x downwards."""

    def __init__(self, parameters: ServoParameters) -> None:
        self._speed = math.radians(parameters.speed_deg)
        self._lowest = math.radians(parameters.lowest_deg)
        self._highest = math.radians(parameters.highest_deg)
        self._angle = 0.0
        self._time = 0.0
        self._goal = 0.0

    def command(self, angle: float) -> None:
        """Turn towards `angle` [rad], at most to the end of the range; raises RefusedInput if it is not finite."""
        if not math.isfinite(angle):
            raise RefusedInput("servo commands refused", f"{angle} rad, must be a finite angle")
        self._goal = min(max(angle, self._lowest), self._highest)

    def angle(self, time: float) -> float:
        """Return the angle [rad] at `time` [s]; at a time before the last one, the servo is where it was last."""
        reach = self._speed * max(time - self._time, 0.0)
        self._time = max(time, self._time)
        way = self._goal - self._angle
        self._angle = self._goal if abs(way) <= reach else self._angle + math.copysign(reach, way)
        return self._angle


def tilted(T_base_sonar: np.ndarray, angle: float) -> np.ndarray:
    """Return the (4, 4) mount of a sonar whose servo is at `angle` [rad], given its mount at 0."""
    return T_base_sonar @ pose_matrix((0.0, 0.0, 0.0), (0.0, angle, 0.0))
