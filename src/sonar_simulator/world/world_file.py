"""Loads a world from a mesh or from an SDF 1.4-1.7 file (sdformat.org): its models, links and their collisions."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import List, Union
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import numpy as np

from sonar_simulator.world.model_files import MESH_SUFFIXES, load_mesh, resolve, sdf_of_model
from sonar_simulator.world.sdf_geometry import GEOMETRIES, Scope, colour_of, element_name, material_of, shape_of
from sonar_simulator.world.world import DEFAULT_MATERIAL, Material, Shape, World, WorldError

VERSIONS = ("1.4", "1.5", "1.6", "1.7")
_NOT_LOADED = ("population", "road", "actor")
# Includes nested deeper than this are taken for a model that includes itself.
_DEEPEST = 20
# Models of Gazebo that worlds often include, known without Gazebo; the sun has no surface.
_LIGHTS = ("model://sun",)
_GROUND_PLANE = ET.fromstring(
    '<model name="ground_plane"><static>true</static><link name="link"><collision name="collision"><geometry><plane>'
    "<normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link></model>"
)


def load_world(path: Union[str, Path]) -> World:
    """Read a world: a mesh if the file's name ends like one, SDF otherwise.

    Raises WorldError if the file cannot be read, is neither or contains no shape at all; a part of an SDF file that
    cannot be loaded becomes a warning, and the rest is loaded.
    """
    path = Path(path)
    if path.suffix.lower() in MESH_SUFFIXES:
        return World.from_shapes(
            path.stem, [Shape(path.stem, "mesh", np.eye(4), (1.0, 1.0, 1.0), mesh=load_mesh(path))]
        )
    root = _parsed(path)
    reader = _Reader(path, [], [])
    if root.get("version") not in VERSIONS:
        reader.warn(f"sdf version={root.get('version')}", f"read as {VERSIONS[-1]}")
    world = root.find("world")
    reader.read_children(root if world is None else world, _Place(np.eye(4), "", DEFAULT_MATERIAL))
    if not reader.shapes:
        raise WorldError("; ".join([f"{path}: no {', '.join(GEOMETRIES)} in it", *reader.warnings]))
    name = None if world is None else world.get("name")
    return World.from_shapes(name or path.stem, reader.shapes, reader.warnings)


@dataclass(frozen=True)
class _Place:
    """The place of an element: its (4, 4) pose in the world, name, default material, and depth of nested includes."""

    pose: np.ndarray
    name: str
    material: Material
    depth: int = 0

    def inside(self, pose: np.ndarray, element: Element, material: Material) -> "_Place":
        name = f"{self.name}/{element_name(element)}" if self.name else element_name(element)
        return _Place(self.pose @ pose, name, material, self.depth)


def _parsed(path: Path) -> Element:
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
    """Reads one file; the readers of included files append to the same lists."""

    def __init__(self, path: Path, shapes: List[Shape], warnings: List[str]) -> None:
        self._path = path
        self.shapes = shapes
        self.warnings = warnings

    def warn(self, element: str, reason: str) -> None:
        self.warnings.append(f"{self._path}: {element}: {reason}")

    def read_children(self, parent: Element, place: _Place) -> None:
        """Read models, nested models, includes and links below `parent`."""
        scope = Scope(parent, self.warn)
        for child in parent:
            if child.tag in _NOT_LOADED:
                self.warn(place.inside(np.eye(4), child, place.material).name, f"<{child.tag}> is not known, left out")
            elif child.tag in ("model", "link", "include"):
                self._read_placed(child, scope, place)

    def _read_placed(self, element: Element, scope: Scope, place: _Place) -> None:
        name = place.inside(np.eye(4), element, place.material).name
        try:
            pose = scope.pose(element, name)
        except ValueError as error:
            self.warn(name, f"{error}, left out")
            return
        inside = place.inside(pose, element, self._material(element, place.material, name))
        if element.tag == "model":
            self.read_children(element, inside)
        elif element.tag == "include":
            self._read_include(element, inside)
        else:
            self._read_link(element, scope, pose, place, inside)

    def _read_include(self, element: Element, place: _Place) -> None:
        uri = (element.findtext("uri") or "").strip()
        if uri in _LIGHTS:
            return
        found = resolve(uri, self._path.parent) if uri else None
        if found is None and uri == "model://ground_plane":
            self.read_children(_GROUND_PLANE, place)
        elif found is None:
            self.warn(place.name, f"<include> {uri or 'without <uri>'} is not there, nor on the model path, left out")
        elif place.depth >= _DEEPEST:
            self.warn(place.name, f"<include> {uri} includes itself, left out")
        else:
            self._read_model_file(element, sdf_of_model(found), place)

    def _read_model_file(self, include: Element, path: Path, place: _Place) -> None:
        try:
            model = _parsed(path).find("model")
        except WorldError as error:
            self.warn(place.name, f"<include>: {error}, left out")
            return
        if model is None:
            self.warn(place.name, f"<include>: {path}: no <model> in it, left out")
            return
        reader = _Reader(path, self.shapes, self.warnings)
        own = np.eye(4)
        if include.find("pose") is None:
            own = Scope(model, reader.warn).pose(model, place.name)
        material = reader._material(model, place.material, place.name)
        reader.read_children(model, _Place(place.pose @ own, place.name, material, place.depth + 1))

    def _read_link(self, link: Element, scope: Scope, T_scope_link: np.ndarray, model: _Place, inside: _Place) -> None:
        colour = colour_of(link)
        for part in link.findall("collision") or link.findall("visual"):
            name = f"{inside.name}/{element_name(part)}"
            material = self._material(part, inside.material, name)
            for geometry in part.findall("geometry/*"):
                if geometry.tag == "empty":
                    continue
                if geometry.tag not in GEOMETRIES:
                    self.warn(name, f"geometry <{geometry.tag}> is not supported, left out")
                    continue
                try:
                    pose = model.pose @ scope.pose_in_link(part, name, T_scope_link)
                    shape = shape_of(geometry, name, pose, part.tag == "collision", self._path.parent)
                    self.shapes.append(replace(shape, material=material, colour=colour))
                except ValueError as error:
                    self.warn(name, f"{error}, left out")

    def _material(self, element: Element, inherited: Material, name: str) -> Material:
        try:
            return material_of(element, inherited)
        except ValueError as error:
            self.warn(name, f"{error}; taken as {inherited.name}")
            return inherited
