"""Finds the files that a world file names: models and meshes, on a model path."""

import os
from pathlib import Path
from typing import Optional, Tuple
from xml.etree import ElementTree as ET

PATH_VARIABLES = (
    "GAZEBO_MODEL_PATH", "SDF_PATH", "GAZEBO_RESOURCE_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH",
)  # fmt: skip
_HOME_MODELS = "~/.gazebo/models"
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
