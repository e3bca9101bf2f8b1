"""What elements of an SDF file say: frames, poses, shapes, materials and colours (sdformat.org)."""

import dataclasses
import math
from pathlib import Path
from typing import Callable, Optional, Tuple
from xml.etree.ElementTree import Element

import numpy as np

from node_support.geometry import pose_matrix
from sonar_simulator.world.model_files import load_mesh, resolve
from sonar_simulator.world.world import (
    DEFAULT_MATERIAL,
    FARTHEST,
    MATERIALS,
    Colour,
    Material,
    Shape,
    material_of_reflection,
)

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
    """Return the numbers in an element's text. Raises ValueError unless they are `count` ones up to `FARTHEST`."""
    words = (element.text or "").split()
    try:
        found = tuple(float(word) for word in words)
    except ValueError:
        found = ()
    if len(found) != count or not all(abs(number) <= FARTHEST for number in found):
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


_SIZES = {"box": (("size", 3),), "cylinder": (("radius", 1), ("length", 1)), "sphere": (("radius", 1),)}
GEOMETRIES = (*_SIZES, "plane", "mesh")
_PROPERTIES = ("reflection", "slope", "lambert_db", "mirror")


def shape_of(geometry: Element, name: str, pose: np.ndarray, is_collision: bool, beside: Path) -> Shape:
    """Return the shape that a child of <geometry> describes; `beside` is the folder of its file.

    pose: (4, 4) in the world. Raises ValueError or WorldError that say what is wrong with it.
    """
    if geometry.tag == "plane":
        return _plane(geometry, name, pose, is_collision)
    if geometry.tag == "mesh":
        return _mesh(geometry, name, pose, beside)
    return Shape(name, geometry.tag, pose, _size(geometry))


def material_of(element: Element, inherited: Material) -> Material:
    """Return the material of a model, link or collision; raises ValueError for an invalid one.

    <NAMESPACE:material>NAME</...> selects one from the table, and attributes change its properties;
    <laser_retro> above 0 is the share of pressure that is reflected.
    """
    named = next((child for child in element if child.tag.endswith("}material")), None)
    if named is not None:
        return _named_material(named)
    retro = element.find("laser_retro")
    reflection = 0.0 if retro is None else numbers(retro, 1)[0]
    return material_of_reflection(min(1.0, reflection)) if reflection > 0.0 else inherited


def colour_of(link: Element) -> Optional[Colour]:
    """Return the colour of a link's first visual that has one."""
    for diffuse in link.findall("visual/material/diffuse"):
        words = (diffuse.text or "").split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            continue
        if len(values) in (3, 4) and all(0.0 <= value <= 1.0 for value in values):
            return (values[0], values[1], values[2], values[3] if len(values) == 4 else 1.0)
    return None


def _named_material(element: Element) -> Material:
    name = (element.text or "").strip()
    properties = {key: float(element.attrib[key]) for key in _PROPERTIES if key in element.attrib}
    if name not in MATERIALS and not properties:
        raise ValueError(f"material {name!r}, must be one of {', '.join(MATERIALS)}")
    material = dataclasses.replace(MATERIALS.get(name, DEFAULT_MATERIAL), name=name, **properties)
    shares_fit = 0.0 <= material.reflection <= 1.0 and 0.0 <= material.mirror <= 1.0
    if not (shares_fit and material.slope > 0.0 and math.isfinite(material.slope + material.lambert_db)):
        raise ValueError(f"material {name!r}: reflection and mirror must be from 0 to 1 and slope above 0")
    return material


def _child_numbers(geometry: Element, key: str, default: Tuple[float, ...]) -> Tuple[float, ...]:
    element = geometry.find(key)
    return default if element is None else numbers(element, len(default))


def _size(geometry: Element) -> Tuple[float, ...]:
    size: Tuple[float, ...] = ()
    for key, count in _SIZES[geometry.tag]:
        element = geometry.find(key)
        if element is None:
            raise ValueError(f"<{geometry.tag}> has no <{key}>")
        size += numbers(element, count)
    return _positive(geometry, size)


def _positive(geometry: Element, size: Tuple[float, ...]) -> Tuple[float, ...]:
    if min(size) <= 0.0:
        raise ValueError(f"<{geometry.tag}> of size {size}, must be above 0 m")
    return size


def _plane(geometry: Element, name: str, pose: np.ndarray, is_collision: bool) -> Shape:
    """Return a plane; that of a collision is infinite (sdformat.org), its <size> is only for display."""
    normal = np.array(_child_numbers(geometry, "normal", (0.0, 0.0, 1.0)))
    if not normal.any():
        raise ValueError("<normal> of <plane> is 0 0 0, must have a length")
    size = (math.inf, math.inf) if is_collision else _child_numbers(geometry, "size", (1.0, 1.0))
    return Shape(name, "plane", pose @ _turned_to(normal / np.linalg.norm(normal)), _positive(geometry, size))


def _turned_to(normal: np.ndarray) -> np.ndarray:
    """Return a (4, 4) rotation that takes the z axis to the unit `normal`."""
    across = np.cross(np.eye(3)[int(np.abs(normal).argmin())], normal)
    across /= np.linalg.norm(across)
    turned = np.eye(4)
    turned[:3, :3] = np.column_stack([across, np.cross(normal, across), normal])
    return turned if normal[2] < 1.0 else np.eye(4)


def _mesh(geometry: Element, name: str, pose: np.ndarray, beside: Path) -> Shape:
    uri = (geometry.findtext("uri") or geometry.findtext("filename") or "").strip()
    if not uri:
        raise ValueError("<mesh> has no <uri>")
    path = resolve(uri, beside)
    if path is None:
        raise ValueError(f"<mesh> {uri} is not there, nor on the model path")
    size = _child_numbers(geometry, "scale", (1.0, 1.0, 1.0))
    if 0.0 in size:
        raise ValueError(f"<scale> of <mesh> is {size}, must not be 0")
    submesh = (geometry.findtext("submesh/name") or "").strip()
    vertices, faces = load_mesh(path, submesh)
    if (geometry.findtext("submesh/center") or "").strip() in ("true", "1"):
        vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    return Shape(name, "mesh", pose, size, mesh=(vertices, faces))
