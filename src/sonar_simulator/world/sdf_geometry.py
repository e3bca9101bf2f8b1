"""Shapes and materials from SDF's <geometry> and material elements."""

import dataclasses
import math
from pathlib import Path
from typing import Optional, Tuple
from xml.etree.ElementTree import Element

import numpy as np

from sonar_simulator.world.materials import DEFAULT_MATERIAL, MATERIALS, Colour, Material, material_of_reflection
from sonar_simulator.world.mesh_file import load_mesh
from sonar_simulator.world.model_path import resolve
from sonar_simulator.world.sdf_frames import numbers
from sonar_simulator.world.world import Shape

_SIZES = {"box": (("size", 3),), "cylinder": (("radius", 1), ("length", 1)), "sphere": (("radius", 1),)}
GEOMETRIES = (*_SIZES, "plane", "mesh")
_PROPERTIES = ("reflection", "slope", "lambert_db", "mirror")


def shape_of(geometry: Element, name: str, pose: np.ndarray, is_collision: bool, beside: Path) -> Shape:
    """Return the shape that a child of <geometry> describes; `beside` is the folder of its file.

    pose: (4, 4) in the world. Raises ValueError or WorldError that say what is wrong with it.
    """
    if geometry.tag == "plane":
        return Shape(name, "plane", pose @ _turned_to(_normal(geometry)), _plane_size(geometry, is_collision))
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


def _size(geometry: Element) -> Tuple[float, ...]:
    size: Tuple[float, ...] = ()
    for key, count in _SIZES[geometry.tag]:
        element = geometry.find(key)
        if element is None:
            raise ValueError(f"<{geometry.tag}> has no <{key}>")
        size += numbers(element, count)
    if min(size) <= 0.0:
        raise ValueError(f"<{geometry.tag}> of size {size}, must be above 0 m")
    return size


def _plane_size(geometry: Element, is_collision: bool) -> Tuple[float, ...]:
    """Return the edges, m; the plane of a collision is infinite (sdformat.org), its <size> is only for display."""
    if is_collision:
        return (math.inf, math.inf)
    element = geometry.find("size")
    size = (1.0, 1.0) if element is None else numbers(element, 2)
    if min(size) <= 0.0:
        raise ValueError(f"<plane> of size {size}, must be above 0 m")
    return size


def _normal(geometry: Element) -> np.ndarray:
    element = geometry.find("normal")
    normal = np.array((0.0, 0.0, 1.0) if element is None else numbers(element, 3))
    if not normal.any():
        raise ValueError("<normal> of <plane> is 0 0 0, must have a length")
    return normal / np.linalg.norm(normal)


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
    scale = geometry.find("scale")
    size = (1.0, 1.0, 1.0) if scale is None else numbers(scale, 3)
    if 0.0 in size:
        raise ValueError(f"<scale> of <mesh> is {size}, must not be 0")
    submesh = (geometry.findtext("submesh/name") or "").strip()
    vertices, faces = load_mesh(path, submesh)
    if (geometry.findtext("submesh/center") or "").strip() in ("true", "1"):
        vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    return Shape(name, "mesh", pose, size, mesh=(vertices, faces))
