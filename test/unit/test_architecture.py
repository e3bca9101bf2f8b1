"""Which modules know of ROS, and which packages know of each other."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCES = Path(__file__).resolve().parents[2] / "src"
ALLOWED = {
    "node_support": set(),
    "imagenex_852_driver": {"node_support"},
    "sonar_processing": {"node_support"},
    "mlsm_manager": {"node_support", "sonar_processing"},
    "sonar_simulator": {"node_support", "sonar_processing"},
}
# Nodes, conversions and markers; every other module is a core and runs without ROS.
ROS_SIDE = {
    "imagenex_852_driver": {"driver_node", "emulator_node", "log_tools", "messages", "nodes"},
    "mlsm_manager": {
        "bag_recording", "fix_publisher", "map_bag", "map_publisher", "map_transform", "markers", "mlsm_core", "nodes",
        "odometry_track",
    },
    "node_support": {"live_parameters", "node", "reconfigure_description"},
    "sonar_processing": {
        "beam_subscriber", "cloud_publisher", "conversions", "figure_publisher", "host", "nodes", "shape_detectors",
        "shape_messages", "sonar_control", "sonar_image", "sonar_places", "sonar_to_cloud", "stage_runner",
        "transform_filter", "transforms", "turn_publisher", "velocity_subscriber",
    },
    "sonar_simulator": {
        "bag_tool", "bag_writer", "gazebo_messages", "gazebo_node", "nodes", "simulator_messages", "simulator_node",
        "simulator_publisher", "world_marker",
    },
}  # fmt: skip
IMPORT_WITHOUT_ROS = """
import importlib, sys

class NoRos:
    NAMES = {"rospy", "roslib", "rosgraph", "rosbag", "genpy", "message_filters", "dynamic_reconfigure",
             "underwater_map_construction"}

    def find_spec(self, name, path=None, target=None):
        top = name.split(".")[0]
        if top in self.NAMES or top.startswith("tf2_") or top.endswith(("_msgs", "_srvs")):
            raise ImportError("no ROS here: " + top)

sys.meta_path.insert(0, NoRos())
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ImportError as error:
        print(name, error)
"""


def _modules(package):
    paths = sorted((SOURCES / package).rglob("*.py"))
    names = [path.relative_to(SOURCES).with_suffix("") for path in paths]
    return {".".join(name.parts).replace(".__init__", ""): path for name, path in zip(names, paths)}


def _imported(path):
    """Return the top-level names that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(), feature_version=(3, 8))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module.split(".")[0])
    return names


def test_every_package_is_in_the_tables():
    packages = {path.parent.name for path in SOURCES.glob("*/__init__.py")}
    assert packages == set(ALLOWED) == set(ROS_SIDE)


@pytest.mark.parametrize("package", ALLOWED)
def test_a_package_imports_only_those_it_may(package):
    others = set(ALLOWED) - ALLOWED[package] - {package}
    wrong = {name: _imported(path) & others for name, path in _modules(package).items() if _imported(path) & others}
    assert wrong == {}


def test_every_core_module_can_be_imported_without_ros_and_no_other():
    names = [name for package in ALLOWED for name in _modules(package)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(SOURCES), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-c", IMPORT_WITHOUT_ROS, *names]
    output = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True).stdout
    expected = {f"{package}.{module}" for package, modules in ROS_SIDE.items() for module in modules}
    assert {line.split()[0] for line in output.splitlines()} == expected, output
