"""`pip install .` in a Python without ROS gives map_bag, simulate_bag, convert_bag and the cores."""

import json
from pathlib import Path

import pytest
from plain_python import install, run

SOURCES = Path(__file__).resolve().parents[2] / "src"
IMPORT_ALL = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
print(len(sys.argv) - 1, "rospy" in sys.modules)
"""


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory):
    install(tmp_path_factory.mktemp("checkout"))


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bag")
    (folder / "script.yaml").write_text("moves: [{wait: 20}, {x: 2, seconds: 20}, {wait: 20}]")
    rays = ["--set", "sonar.ray_rows=5", "--set", "sonar.ray_columns=2", "--quiet"]
    run("simulate_bag", "--world", "basin", "--script", "script.yaml", "--out", "basin.bag", *rays, folder=folder)
    return folder / "basin.bag"


def test_there_is_no_ros(tmp_path):
    found = "import importlib.util; print([importlib.util.find_spec(name) for name in ('rospy', 'rosbag', 'genpy')])"
    assert run("python", "-c", found, folder=tmp_path).strip() == "[None, None, None]"


def test_every_core_can_be_imported(tmp_path):
    paths = [path.relative_to(SOURCES).with_suffix("") for path in sorted(SOURCES.rglob("*.py"))]
    names = [".".join(path.parts) for path in paths if "ros" not in path.parts]
    assert run("python", "-c", IMPORT_ALL, *names, folder=tmp_path).split() == [str(len(names)), "False"]


def test_a_simulated_bag_becomes_a_map_that_can_be_looked_at(bag, tmp_path):
    told = run("map_bag", bag, "--out", "map", "--no-calibrate", "--truth", "/ground_truth", folder=tmp_path)
    assert "4 scans" in told
    assert json.loads((tmp_path / "map/summary.json").read_text())["corrected"]["mean"] < 0.3
    assert "blocks" in run("map_tool", "info", "map/map.mlsm", folder=tmp_path)


def test_a_bag_is_inspected_and_converted(bag, tmp_path):
    assert "start with:" in run("map_bag", "--inspect", bag, folder=tmp_path)
    assert "451 beams" in run("convert_bag", bag, "out.bag", folder=tmp_path)
