"""Poses in SDF: of elements in their model or world, including those `relative_to` other frames of it."""

import math
from typing import Callable, Tuple
from xml.etree.ElementTree import Element

import numpy as np

from node_support.geometry import pose_matrix

_SCOPE_ITSELF = ("", "__model__", "__root__", "world")
_NAMED = ("model", "link", "frame", "joint", "include")
_DEFAULT_BASE = {"frame": "attached_to", "joint": "child"}


class Scope:
    """A world or a model, with the frames that poses inside it may name."""

    def __init__(self, element: Element, warn: Callable[[str, str], None]) -> None:
        self._named = {element_name(child): child for child in element if child.tag in _NAMED}
        self._warn = warn

    def pose(self, element: Element, name: str, seen: Tuple[str, ...] = ()) -> np.ndarray:
        """Return (4, 4) T_scope_element of a child of the scope. Raises ValueError for an invalid pose."""
        pose = element.find("pose")
        base = _base(element, pose)
        return self._frame(base, name, seen) @ own_pose(element)

    def pose_in_link(self, element: Element, name: str, T_scope_link: np.ndarray) -> np.ndarray:
        """Return (4, 4) T_scope_element of a collision or visual in a link. Raises ValueError as `pose` does."""
        base = _named_frame(element.find("pose"))
        return (self._frame(base, name, ()) if base else T_scope_link) @ own_pose(element)

    def _frame(self, base: str, name: str, seen: Tuple[str, ...]) -> np.ndarray:
        if base in _SCOPE_ITSELF:
            return np.eye(4)
        if base in seen:
            raise ValueError(f"<pose> is relative to itself by way of {base!r}")
        if base not in self._named:
            self._warn(name, f"<pose> names the frame {base!r}, which is not there; taken as relative to its parent")
            return np.eye(4)
        return self.pose(self._named[base], name, (*seen, base))


def element_name(element: Element) -> str:
    """Return the name of an element."""
    name = element.get("name") or element.findtext("name") or element.findtext("uri") or element.tag
    return name.strip()


def own_pose(element: Element) -> np.ndarray:
    """Return the (4, 4) matrix of an element's <pose>, the identity if it has none. Raises ValueError."""
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    values = list(numbers(pose, 6))
    if pose.get("degrees") in ("true", "1"):
        values[3:] = np.radians(values[3:])
    return pose_matrix(values[:3], values[3:])


def numbers(element: Element, count: int) -> Tuple[float, ...]:
    """Return the numbers in an element's text. Raises ValueError unless they are `count` finite numbers."""
    words = (element.text or "").split()
    try:
        found = tuple(float(word) for word in words)
    except ValueError:
        found = ()
    if len(found) != count or not all(math.isfinite(number) for number in found):
        raise ValueError(f"<{element.tag}> is {' '.join(words)!r}, must be {count} number{'s' * (count > 1)}")
    return found


def _base(element: Element, pose: Element) -> str:
    named = _named_frame(pose)
    if named or element.tag not in _DEFAULT_BASE:
        return named
    base = _DEFAULT_BASE[element.tag]
    return (element.get(base) or element.findtext(base) or "").strip()


def _named_frame(pose: Element) -> str:
    return "" if pose is None else (pose.get("relative_to") or pose.get("frame") or "").strip()
