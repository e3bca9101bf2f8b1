"""Loads a world from an SDF 1.4-1.7 file (sdformat.org): models and links of boxes, cylinders and spheres."""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import List, Tuple, Union

import numpy as np

from sonar_simulator.poses import pose_matrix
from sonar_simulator.world import Shape, World

VERSIONS = ("1.4", "1.5", "1.6", "1.7")
_SIZES = {"box": (("size", 3),), "cylinder": (("radius", 1), ("length", 1)), "sphere": (("radius", 1),)}
_NOT_LOADED = ("include", "population", "road", "actor")


class WorldError(ValueError):
    """No world can be made of a file; the text names the file."""


@dataclass(frozen=True)
class LoadedWorld:
    """A world and, one line each, what its file holds that could not be given."""

    world: World
    warnings: Tuple[str, ...]


def load_sdf(path: Union[str, Path]) -> LoadedWorld:
    """Read a world file. What cannot be given becomes a warning and the rest loads.

    Raises WorldError when the file cannot be read, is not XML, is not SDF or leaves no shape at all.
    """
    root = _parsed(path)
    reader = _Reader(str(path))
    if root.get("version") not in VERSIONS:
        reader.warn(f"sdf version={root.get('version')}", f"read as {VERSIONS[-1]}")
    world = root.find("world")
    reader.read_children(root if world is None else world, np.eye(4), "")
    if not reader.shapes:
        raise WorldError("; ".join([f"{path}: no box, cylinder or sphere in it", *reader.warnings]))
    name = None if world is None else world.get("name")
    return LoadedWorld(World.from_shapes(name or Path(path).stem, reader.shapes), tuple(reader.warnings))


def _parsed(path: Union[str, Path]) -> ET.Element:
    try:
        root = ET.parse(str(path)).getroot()
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror}") from error
    except ET.ParseError as error:
        raise WorldError(f"{path}: not XML: {error}") from error
    if root.tag != "sdf":
        raise WorldError(f"{path}: not an SDF file, its root element is <{root.tag}>")
    return root


class _Reader:
    def __init__(self, path: str) -> None:
        self._path = path
        self.shapes: List[Shape] = []
        self.warnings: List[str] = []

    def warn(self, element: str, reason: str) -> None:
        self.warnings.append(f"{self._path}: {element}: {reason}")

    def read_children(self, parent: ET.Element, T_world_parent: np.ndarray, parent_name: str) -> None:
        """Walk models, nested models and links below `parent`."""
        for child in parent:
            name = _joined(parent_name, child)
            if child.tag in _NOT_LOADED:
                self.warn(name, f"<{child.tag}> is not supported, left out")
            elif child.tag in ("model", "link"):
                self._read_placed(child, T_world_parent, name)

    def _read_placed(self, element: ET.Element, T_world_parent: np.ndarray, name: str) -> None:
        try:
            pose = T_world_parent @ self._pose(element, name)
        except ValueError as error:
            self.warn(name, f"{error}, left out")
            return
        if element.tag == "model":
            self.read_children(element, pose, name)
            return
        for part in element.findall("collision") or element.findall("visual"):
            self._read_shape(part, pose, _joined(name, part))

    def _read_shape(self, element: ET.Element, T_world_link: np.ndarray, name: str) -> None:
        for geometry in element.findall("geometry/*"):
            if geometry.tag == "empty":
                continue
            if geometry.tag not in _SIZES:
                self.warn(name, f"geometry <{geometry.tag}> is not supported, left out")
                continue
            try:
                pose = T_world_link @ self._pose(element, name)
                self.shapes.append(Shape(name, geometry.tag, pose, _size(geometry)))
            except ValueError as error:
                self.warn(name, f"{error}, left out")

    def _pose(self, element: ET.Element, name: str) -> np.ndarray:
        pose = element.find("pose")
        if pose is None:
            return np.eye(4)
        if pose.get("relative_to") or pose.get("frame"):
            self.warn(name, "<pose> names a frame, which is not supported; taken as relative to its parent")
        numbers = _numbers(pose, 6) if (pose.text or "").strip() else (0.0,) * 6
        return pose_matrix(numbers[:3], numbers[3:])


def _joined(parent_name: str, element: ET.Element) -> str:
    name = element.get("name") or element.findtext("name") or element.findtext("uri") or element.tag
    return f"{parent_name}/{name.strip()}" if parent_name else name.strip()


def _size(geometry: ET.Element) -> Tuple[float, ...]:
    size: Tuple[float, ...] = ()
    for key, count in _SIZES[geometry.tag]:
        element = geometry.find(key)
        if element is None:
            raise ValueError(f"<{geometry.tag}> has no <{key}>")
        size += _numbers(element, count)
    if min(size) <= 0.0:
        raise ValueError(f"<{geometry.tag}> of size {size}, must be above 0 m")
    return size


def _numbers(element: ET.Element, count: int) -> Tuple[float, ...]:
    words = (element.text or "").split()
    try:
        numbers = tuple(float(word) for word in words)
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"<{element.tag}> is {' '.join(words)!r}, must be {count} number{'s' * (count > 1)}")
    return numbers
