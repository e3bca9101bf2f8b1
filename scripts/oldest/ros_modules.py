"""Lends the pure Python modules of the installed ROS to a Python that ROS was not built for.

A line in the environment's site-packages imports this at the start of every process, so that scripts run by tests find
ROS too. What the environment has itself goes first: numpy and all others keep their old versions.
"""

import os
import sys
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import List, Optional, Sequence


class CompiledModuleError(ImportError):
    """A module of the installed ROS is compiled for another Python."""


class RosModules:
    """A finder of top-level modules in `folders`; raises CompiledModuleError for one with compiled parts."""

    def __init__(self, folders: Sequence[str]) -> None:
        self._folders = list(folders)

    def find_spec(self, name: str, path: object = None, target: object = None) -> Optional[ModuleSpec]:
        """Return the spec of a top-level module, None when the folders do not have it; see importlib."""
        spec = PathFinder.find_spec(name, self._folders) if "." not in name else None
        if spec is not None and _is_compiled(spec):
            raise CompiledModuleError(f"{name} is compiled for another Python", name=name)
        return spec


def _is_compiled(spec: ModuleSpec) -> bool:
    folders = spec.submodule_search_locations or []
    return str(spec.origin).endswith(".so") or any(True for folder in folders for _ in Path(folder).rglob("*.so"))


def _folders() -> List[str]:
    return [folder for folder in os.environ.get("ROS_PYTHON_FOLDERS", "").split(os.pathsep) if folder]


if _folders():
    sys.meta_path.append(RosModules(_folders()))
