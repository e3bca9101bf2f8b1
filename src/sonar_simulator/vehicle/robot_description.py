"""Reads from a robot's description (URDF) where its parts are mounted."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Tuple

import numpy as np

from node_support.geometry import pose_matrix


class DescriptionError(ValueError):
    """A robot's description cannot be used; the text says what is missing or wrong."""


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
        """Raises DescriptionError if the text is not a URDF."""
        try:
            root = ET.fromstring(urdf)
        except ET.ParseError as error:
            raise DescriptionError(f"robot_description: not XML: {error}") from error
        self._joints: Dict[str, Joint] = {}
        for element in root.findall("joint"):
            joint = _joint(element)
            self._joints[joint.child] = joint

    @classmethod
    def from_file(cls, path: Path) -> "RobotDescription":
        """Read a URDF file; raises DescriptionError."""
        try:
            return cls(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise DescriptionError(f"{path}: {getattr(error, 'strerror', None) or 'not a text'}") from error

    @property
    def fixed_joints(self) -> List[Joint]:
        """Return the fixed joints, which belong on /tf_static."""
        return [joint for joint in self._joints.values() if joint.is_fixed]

    def mount(self, base: str, link: str) -> np.ndarray:
        """Return the (4, 4) T_base_link with every joint at zero; raises DescriptionError if no joints lead there."""
        pose, child = np.eye(4), link
        for _ in range(len(self._joints) + 1):
            if child == base:
                return pose
            if child not in self._joints:
                break
            pose = self._joints[child].T_parent_child @ pose
            child = self._joints[child].parent
        raise DescriptionError(f"robot_description: no joints lead from {base} to {link}")


def _joint(element: ET.Element) -> Joint:
    name = element.get("name", "?")
    parent, child, origin = element.find("parent"), element.find("child"), element.find("origin")
    if parent is None or child is None:
        raise DescriptionError(f"robot_description: joint {name} has no parent or no child")
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
        raise DescriptionError(f"robot_description: joint {joint}: {key} = {text!r}: must be three numbers")
    return values
