"""map_bag as it is run: bags in, files, figures and one-line errors out."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import rosbag
import yaml

from mlsm_manager.offline.live_file import replay_values

# map_bag runs as a process of its own here, so that its import of a compiled module of ROS does not show.
pytest.importorskip("tf2_py")

ROOT = Path(__file__).resolve().parents[3]
BASIN = ROOT / "test/data/basin.bag"
FILES = {"map.ply", "map.png", "trajectory.csv", "live.yaml", "summary.json"}
COMMAND = [sys.executable, str(ROOT / "nodes/map_bag")]


def run(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False)


def refused(*arguments):
    """Return the one line with which map_bag refuses."""
    done = run(*arguments)
    lines = done.stderr.strip().splitlines()
    assert (done.returncode, len(lines)) == (1, 1), done.stderr
    return lines[0]


def summary_of(folder):
    return json.loads((folder / "summary.json").read_text())


@pytest.fixture(scope="module")
def basin(tmp_path_factory):
    folder = tmp_path_factory.mktemp("basin")
    done = run(BASIN, "--out", folder, "--truth", "/ground_truth", "--refine")
    assert done.returncode == 0, done.stderr
    return folder


def test_a_simulated_bag_gives_all_files(basin):
    assert {path.name for path in basin.iterdir()} == FILES


def test_the_same_command_writes_the_same_bytes(basin, tmp_path):
    assert run(BASIN, "--out", tmp_path, "--truth", "/ground_truth", "--refine").returncode == 0
    for name in FILES - {"summary.json"}:
        assert (tmp_path / name).read_bytes() == (basin / name).read_bytes(), name


def test_the_summary_has_the_promised_keys(basin):
    summary = summary_of(basin)
    counts = {"scans", "matched", "rejected", "blocks", "seconds", "times_real_time"}
    assert counts <= set(summary)
    for name in ("dead_reckoning", "corrected", "refined"):
        assert set(summary[name]) == {"mean", "sd", "max"}
    assert summary["matched"] >= 5
    assert set(summary["calibration"]) == {"range_scale", "sonar_delay", "odometry_scale", "odometry_direction"}
    for check in summary["checks"].values():
        assert set(check) == {"value", "limit", "fires", "meaning"}
    assert all(deviation is None or deviation > 0.0 for deviation in summary["deviation_per_minute"])


def test_a_run_without_doubts_says_so_in_its_last_figure(basin):
    assert summary_of(basin)["trust"] == f"trust: all {len(summary_of(basin)['checks'])} checks are fine"


def test_the_scan_by_scan_matcher_makes_no_checks(tmp_path):
    done = run(BASIN, "--out", tmp_path, "--matcher", "DISTRIBUTIONS")
    assert done.returncode == 0, done.stderr
    assert not {"checks", "trust", "calibration"} & set(summary_of(tmp_path))


def test_a_simulated_basin_is_mapped_where_it_is(basin):
    table = np.genfromtxt(basin / "trajectory.csv", delimiter=",", names=True)
    assert {"time", "odometry_x", "corrected_yaw", "refined_y"} <= set(table.dtype.names)
    summary = summary_of(basin)
    assert summary["corrected"]["mean"] < 1.2
    assert summary["refined"]["mean"] < 1.0
    assert summary["echoes"]["mode"] == "MATCHED_FILTER"


def test_what_it_found_is_what_another_run_begins_with(basin, tmp_path):
    assert run(BASIN, "--out", tmp_path, "--parameters", basin / "live.yaml").returncode == 0
    found, again = (summary_of(folder)["calibration"] for folder in (basin, tmp_path))
    for name in ("range_scale", "sonar_delay"):
        assert abs(again[name]["value"]) <= found[name]["deviation"], name
        assert again[name]["deviation"] <= found[name]["deviation"], name


def test_a_missing_bag_is_named(tmp_path):
    assert refused("/no/such.bag", "--out", tmp_path) == "map_bag: /no/such.bag: No such file or directory"


def test_a_missing_topic_is_answered_with_those_there_are(tmp_path):
    line = refused(BASIN, "--out", tmp_path, "--truth", "/gps")
    assert "no topic /gps" in line
    assert "/ground_truth" in line


def test_an_empty_bag_is_refused(tmp_path):
    rosbag.Bag(str(tmp_path / "empty.bag"), "w").close()
    assert "there are none at all" in refused(tmp_path / "empty.bag", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_bag_without_tf_is_refused(tmp_path):
    with rosbag.Bag(str(BASIN)) as whole, rosbag.Bag(str(tmp_path / "beams.bag"), "w") as beams:
        for topic, message, stamp in whole.read_messages(topics=["/sonar/raw"]):
            beams.write(topic, message, stamp)
    assert "no /tf" in refused(tmp_path / "beams.bag", "--out", tmp_path / "out")


def test_a_parameter_out_of_range_is_answered_with_the_range(tmp_path):
    line = refused(BASIN, "--out", tmp_path, "--set", "echo_deviation=30")
    assert line == "map_bag: echo_deviation = 30: must be a number from 0.01 to 10 m"


def test_an_unknown_parameter_is_named(tmp_path):
    assert "no_such = 1: no such parameter" in refused(BASIN, "--out", tmp_path, "--set", "no_such=1")


def test_parameters_of_a_file_are_taken_and_held(tmp_path):
    (tmp_path / "mine.yaml").write_text("sonar_delay: 0.25\nmin_points: 20\n")
    done = run(BASIN, "--out", tmp_path / "out", "--parameters", tmp_path / "mine.yaml", "--set", "range_scale=0.99")
    assert done.returncode == 0, done.stderr
    mine = replay_values(yaml.safe_load((tmp_path / "out/live.yaml").read_text()))
    assert mine["min_points"] == 20
    calibration = summary_of(tmp_path / "out")["calibration"]
    assert mine["sonar_delay"] == pytest.approx(0.25 + calibration["sonar_delay"]["value"], abs=1e-4)
    assert mine["range_scale"] == pytest.approx(0.99 * (1.0 + calibration["range_scale"]["value"]), abs=1e-4)


def test_ctrl_c_ends_it_within_two_seconds_and_leaves_nothing(tmp_path):
    terminal, end = pty.openpty()
    process = subprocess.Popen([*COMMAND, str(BASIN), "--out", str(tmp_path), "--refine"], stderr=end)
    shown = b""
    while b"match" not in shown:
        shown += os.read(terminal, 4096)
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    assert process.wait(timeout=10) == 1
    assert time.monotonic() - start < 2.0
    assert list(tmp_path.iterdir()) == []
