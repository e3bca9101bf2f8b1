"""Files that a world names: where they are, which SDF a model's folder offers, and meshes."""

import os
from pathlib import Path
from typing import Dict, List, Optional, Tuple
from xml.etree import ElementTree as ET

import numpy as np

from sonar_simulator.world.primitives import Mesh, joined
from sonar_simulator.world.world import FARTHEST, MissingPackageError, WorldError

PATH_VARIABLES = (
    "GAZEBO_MODEL_PATH", "SDF_PATH", "GAZEBO_RESOURCE_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH",
)  # fmt: skip
_HOME_MODELS = "~/.gazebo/models"
_GREATEST = 1e30  # of a file's own unit: what is greater overflows when it is squared, or has done so already
_NEWEST = (1, 7)  # Newest version of SDF that is read


def model_folders() -> Tuple[Path, ...]:
    """Return the folders in Gazebo's environment variables, and its folder in the home directory."""
    named = [folder for variable in PATH_VARIABLES for folder in os.environ.get(variable, "").split(os.pathsep)]
    return tuple(Path(os.path.expanduser(folder)) for folder in [*named, _HOME_MODELS] if folder)


def resolve(uri: str, beside: Path) -> Optional[Path]:
    """Return the file or folder that a URI names, or None when there is none.

    uri: model://NAME/..., package://NAME/..., file://..., or a path. beside: the folder of the file that names it;
    it, its `models` and the model path are searched.
    """
    scheme, separator, rest = uri.strip().partition("://")
    if not separator:
        scheme, rest = "", uri.strip()
    if scheme == "package":
        return _in_package(rest)
    if scheme not in ("", "model", "file"):
        return None
    folders = (beside, beside / "models", beside.parent, *model_folders())
    candidates = [Path(rest)] if os.path.isabs(rest) else [folder / rest for folder in folders]
    return next((path for path in candidates if path.exists()), None)


def _in_package(rest: str) -> Optional[Path]:
    try:
        from rospkg import ResourceNotFound, RosPack
    except ImportError:
        return None
    name, _, inside = rest.partition("/")
    try:
        path = Path(RosPack().get_path(name)) / inside
    except ResourceNotFound:
        return None
    return path if path.exists() else None


def sdf_of_model(folder: Path) -> Path:
    """Return the SDF file of a model's folder: the newest version up to 1.7 in its model.config, or model.sdf."""
    if folder.is_file():
        return folder
    try:
        offered = ET.parse(str(folder / "model.config")).getroot().findall("sdf")
    except (OSError, ET.ParseError):
        offered = []
    fitting = [element for element in offered if element.text and _version(element) <= _NEWEST] or [
        element for element in offered if element.text
    ]
    return folder / (max(fitting, key=_version).text.strip() if fitting else "model.sdf")


def _version(element: ET.Element) -> Tuple[int, ...]:
    words = element.get("version", "").split(".")
    return tuple(int(word) for word in words) if all(word.isdigit() for word in words) else (0,)


MESH_SUFFIXES = (".dae", ".stl", ".obj", ".ply", ".glb", ".gltf")
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_X_UP = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
_COLLADA_AXES: Dict[str, np.ndarray] = {"X_UP": _X_UP, "Y_UP": _Y_UP, "Z_UP": np.eye(3)}


def load_mesh(path: Path, submesh: str = "") -> Mesh:
    """Return vertices (n, 3) in m, z up, and faces (m, 3) of a mesh file, or of one named mesh in it.

    Collada states its unit and up axis, glTF is in metres with y up; others are taken to be in metres with z up.
    Raises WorldError, naming the file.
    """
    parts = _parts(path)
    if submesh:
        parts = [part for part in parts if part[0] == submesh]
        if not parts:
            raise WorldError(f"{path}: no mesh {submesh!r} in it")
    vertices, faces = joined([(corners, triangles) for _, corners, triangles in parts])
    vertices = vertices @ _to_metres_z_up(path).T
    if not len(faces):
        raise WorldError(f"{path}: no triangle in it")
    if faces.max() >= len(vertices) or faces.min() < 0:
        raise WorldError(f"{path}: a triangle names a vertex that is not there")
    if not (np.abs(vertices) <= FARTHEST).all():
        raise WorldError(f"{path}: a vertex is farther than {FARTHEST:g} m from the origin")
    return vertices, faces


def _parts(path: Path) -> List[Tuple[str, np.ndarray, np.ndarray]]:
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise WorldError(f"{path}: a mesh must be one of {', '.join(MESH_SUFFIXES)}")
    try:
        import trimesh

        if path.suffix.lower() == ".dae":
            # trimesh reads Collada with it, and without it would call every such file broken.
            import collada  # noqa: F401
    except ImportError as error:
        raise MissingPackageError("reads meshes", "trimesh pycollada", error) from error
    try:
        # numpy's warnings are of numbers that are refused below.
        with np.errstate(all="ignore"):
            scene = trimesh.load(str(path), force="scene", process=False)
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror or error}") from error
    except Exception as error:
        # Each reader fails in its own way on a file whose content does not match its name.
        reason = " ".join(str(error).split())
        raise WorldError(f"{path}: not a mesh: {type(error).__name__}: {reason}") from error
    parts = []
    for node in scene.graph.nodes_geometry:
        T_scene_node, name = scene.graph[node]
        geometry = scene.geometry[name]
        if len(getattr(geometry, "faces", ())):
            corners = _corners(path, geometry.vertices) @ T_scene_node[:3, :3].T + T_scene_node[:3, 3]
            parts.append((name, corners, np.asarray(geometry.faces)))
    return parts


def _corners(path: Path, vertices: np.ndarray) -> np.ndarray:
    corners = np.asarray(vertices, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1] != 3:
        raise WorldError(f"{path}: a vertex has {corners.shape[-1]} coordinates, must have 3")
    if not (np.abs(corners) < _GREATEST).all():
        raise WorldError(f"{path}: a vertex is not finite")
    return corners


def _to_metres_z_up(path: Path) -> np.ndarray:
    """Return the (3, 3) matrix from a file's coordinates to metres with z up."""
    suffix = path.suffix.lower()
    if suffix in (".glb", ".gltf"):
        return _Y_UP
    if suffix != ".dae":
        return np.eye(3)
    asset = next((child for child in ET.parse(str(path)).getroot() if _local(child) == "asset"), None)
    described = {} if asset is None else {_local(child): child for child in asset}
    text = described["unit"].get("meter", "1") if "unit" in described else "1"
    try:
        unit = float(text)
    except ValueError:
        raise WorldError(f"{path}: <unit meter={text!r}> is not a number") from None
    axis = (described["up_axis"].text or "").strip() if "up_axis" in described else "Y_UP"
    return unit * _COLLADA_AXES.get(axis, _Y_UP)


def _local(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]
