"""Which modules import ROS, which packages import each other, and that neither folders nor files do so in a circle.

Everything is derived from paths: what imports ROS stands in a folder `ros/` of its package.
"""

import ast
import re
from functools import lru_cache

import pytest
from programs import ROOT

SOURCES = ROOT / "src"
ALLOWED = {
    "node_support": set(),
    "autopilot_link": {"node_support", "sonar_driver"},
    "dead_reckoning": {"node_support"},
    "georeferencing": {"node_support"},
    "sonar_driver": {"node_support"},
    "imagenex_852_driver": {"node_support", "sonar_driver"},
    "ping360_driver": {"node_support", "sonar_driver"},
    "sonar_processing": {"node_support"},
    "recordings": {
        "dead_reckoning",
        "georeferencing",
        "imagenex_852_driver",
        "node_support",
        "ping360_driver",
        "sonar_processing",
    },
    "mlsm_manager": {"georeferencing", "node_support", "recordings", "sonar_processing"},
    "web_page": {"georeferencing", "node_support", "sonar_processing"},
    "sonar_simulator": {"node_support", "recordings", "sonar_driver", "sonar_processing"},
}
ROS_NAMES = {
    "rospy", "roslib", "rosgraph", "rosbag", "genpy", "dynamic_reconfigure", "diagnostic_updater",
    "underwater_map_construction",
}  # fmt: skip
ROS_ENDINGS = ("_msgs", "_srvs", "tf2_ros", "tf2_py")


def _modules(package):
    paths = sorted((SOURCES / package).rglob("*.py"))
    names = [path.relative_to(SOURCES).with_suffix("") for path in paths]
    return {".".join(name.parts).replace(".__init__", ""): path for name, path in zip(names, paths)}


@lru_cache(maxsize=None)
def _imported(path):
    """Return the dotted names that a file imports, wherever in it; of ours those of modules."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(), feature_version=(3, 8))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if _path_of(name) else node.module for name in inner}
    return found


def _packages(path):
    return {name.split(".")[0] for name in _imported(path)}


def _imported_modules(path):
    return {name for name in _imported(path) if name.split(".")[0] in ALLOWED}


def _imports_ros(path):
    return any(name in ROS_NAMES or name.endswith(ROS_ENDINGS) for name in _packages(path))


def _is_ros_side(name):
    return "ros" in name.split(".")


def _path_of(name):
    """Return the file of a module or package by its dotted name, None where there is none."""
    path = SOURCES.joinpath(*name.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((candidate for candidate in candidates if candidate.exists()), None)


def _folder(path):
    return path.parent.relative_to(SOURCES).as_posix()


def test_every_package_is_in_the_table():
    packages = {path.parent.name for path in SOURCES.glob("*/__init__.py")}
    assert packages == set(ALLOWED)


@pytest.mark.parametrize("package", ALLOWED)
def test_a_package_imports_only_those_it_may(package):
    others = set(ALLOWED) - ALLOWED[package] - {package}
    assert {name: found for name, path in _modules(package).items() if (found := _packages(path) & others)} == {}


def test_open3d_is_loaded_only_where_it_is_used():
    """It costs a process 0.3 s and 43 MB."""
    eager = [str(path) for path in SOURCES.rglob("*.py") if re.search("^(import|from) open3d", path.read_text(), re.M)]
    assert eager == []


@pytest.mark.parametrize("package", ALLOWED)
def test_no_core_imports_ros(package):
    """That all of them can be imported without it, `test/without_ros` shows."""
    assert [name for name, path in _modules(package).items() if _imports_ros(path) and not _is_ros_side(name)] == []


@pytest.mark.parametrize("package", ALLOWED)
def test_no_core_imports_a_folder_ros(package):
    cores = {name: path for name, path in _modules(package).items() if not _is_ros_side(name)}
    assert [name for name, path in cores.items() if any(map(_is_ros_side, _imported_modules(path)))] == []


@pytest.mark.parametrize("package", ALLOWED)
def test_every_module_in_a_folder_ros_needs_ros(package):
    files = {name: path for name, path in _modules(package).items() if path.name != "__init__.py"}
    ros_side = {name: path for name, path in files.items() if _is_ros_side(name) and not _imports_ros(path)}
    assert [name for name, path in ros_side.items() if not any(map(_is_ros_side, _imported_modules(path)))] == []


@pytest.mark.parametrize("place", [_folder, str], ids=["folders", "files"])
def test_no_two_import_each_other_in_a_circle(place):
    imports = {}
    for path in SOURCES.rglob("*.py"):
        targets = {place(_path_of(target)) for target in _imported_modules(path)}
        imports.setdefault(place(path), set()).update(targets - {place(path)})
    while free := [one for one, targets in imports.items() if not targets & set(imports)]:
        for one in free:
            del imports[one]
    assert sorted(imports) == []


def test_only_the_table_of_odometry_profiles_imports_the_optional_folder_hovering():
    hovering = SOURCES / "mlsm_manager/hovering"
    outside = [path for path in SOURCES.rglob("*.py") if hovering not in path.parents]
    importing = [path for path in outside if any("mlsm_manager.hovering" in name for name in _imported_modules(path))]
    assert importing == [SOURCES / "mlsm_manager/localisation/odometry_profiles.py"]
