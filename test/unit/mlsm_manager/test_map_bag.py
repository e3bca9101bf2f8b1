"""map_bag as it is run: bags in, files, figures and one-line errors out."""

import json
import os
import pty
import re
import subprocess
import sys
import threading
from contextlib import suppress
from importlib.util import find_spec

import numpy as np
import pytest
import rosbag
import yaml
from heading_only import reduce_bag
from programs import BASIN, ROOT, run_program

from mlsm_manager.self_check.verdict import RunAnswer
from mlsm_manager.surface_map.map_file import Layer, read_map
from recordings.bags.bag import Bag

pytestmark = pytest.mark.long
pytest.importorskip("tf2_py")

TRAJECTORIES = ("trajectory.csv", "trajectory_2.csv")
FILES = {
    "map.mlsm", "map.ply", "map.png", "trajectory.csv", "live.yaml", "summary.json",
    "dead_reckoning.tum", "corrected.tum", "refined.tum", "truth.tum",
    *(["report.html"] if find_spec("plotly") else []),
}  # fmt: skip


# The odometry is a DVL's: with AUTO the scale is unknown for the first of these few scans.
CHECKED = ("--truth", "/ground_truth", "--refine", "--check", "--odometry", "dvl")


def run(*arguments):
    return run_program("map_bag", *arguments)


def refused(*arguments):
    """Return the one line with which map_bag refuses."""
    done = run(*arguments)
    lines = done.stderr.strip().splitlines()
    assert (done.returncode, len(lines)) == (1, 1), done.stderr
    return lines[0]


def summary_of(folder):
    return json.loads((folder / "summary.json").read_text())


def command_for(folder):
    return [sys.executable, str(ROOT / "nodes/map_bag"), str(BASIN), "--out", str(folder), *CHECKED]


@pytest.fixture(scope="module")
def basin(tmp_path_factory):
    """Map in a process of its own, as users do: where arrays lie in memory decides about the last bits of sums."""
    folder = tmp_path_factory.mktemp("basin")
    done = subprocess.run(command_for(folder), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def test_a_simulated_bag_gives_all_files(basin):
    assert {path.name for path in basin.iterdir()} == FILES


@pytest.fixture(scope="module")
def on_a_screen(tmp_path_factory):
    """Map once more, as a person sees it; return the folder and what the screen showed."""
    folder, (screen, terminal) = tmp_path_factory.mktemp("again"), pty.openpty()
    shown = []
    reader = threading.Thread(target=_read, args=(screen, shown), daemon=True)
    reader.start()
    status = subprocess.run(command_for(folder), stdout=subprocess.DEVNULL, stderr=terminal, check=False).returncode
    os.close(terminal)
    reader.join()
    assert status == 0, b"".join(shown)
    return folder, b"".join(shown).decode()


def _read(screen, shown):
    """Read until the last program that had the terminal has closed it, which is an error."""
    with suppress(OSError):
        while True:
            shown.append(os.read(screen, 4096))


def test_the_same_command_writes_the_same_bytes(basin, on_a_screen):
    for name in FILES - {"summary.json"}:
        assert (basin / name).read_bytes() == (on_a_screen[0] / name).read_bytes(), name


@pytest.mark.parametrize("bar", ["match", "refine", "check"])
def test_each_bar_reaches_its_total(on_a_screen, bar):
    last = [line for line in re.split(r"[\r\n]+", on_a_screen[1]) if line.startswith(bar)][-1]
    assert re.search(r"100%.* (\d+)/\1 ", last), last


def test_the_summary_has_the_promised_keys(basin):
    summary = summary_of(basin)
    keys = {"scans", "matched", "rejected", "blocks", "seconds", "times_real_time", "echoes", "calibration", "checks"}
    assert {*keys, "deviation_per_minute", "trust"} <= set(summary)
    for name in ("dead_reckoning", "corrected", "refined"):
        assert set(summary[name]) == {"mean", "sd", "max"}
    assert summary["rejected"] == 0


@pytest.mark.parametrize("name", ["spread over settings", "second start"])
def test_fits_with_other_settings_and_from_another_start_are_among_the_checks(basin, name):
    assert not summary_of(basin)["checks"][name]["fires"]


def test_a_simulated_basin_is_mapped_where_it_is(basin):
    table = np.genfromtxt(basin / "trajectory.csv", delimiter=",", names=True)
    assert {"time", "odometry_x", "corrected_yaw", "refined_y"} <= set(table.dtype.names)
    summary = summary_of(basin)
    assert summary["corrected"]["mean"] < 0.1
    assert summary["refined"]["mean"] < 0.1
    assert summary["echoes"]["mode"] == "MATCHED_FILTER"


def test_a_refined_map_has_free_space_between_the_vehicle_and_the_walls(basin):
    layers = read_map(basin / "map.mlsm").layers
    vehicle = np.loadtxt(str(basin / "refined.tum"))[:, 1:3]
    cells = layers[Layer.FREE].cells, layers[Layer.SHOWN].cells, vehicle // layers[Layer.FREE].resolution
    free, walls, passed = ({tuple(cell) for cell in each.astype(int).tolist()} for each in cells)
    assert len(passed & free) > 0.9 * len(passed)
    assert len(walls & free) < 0.2 * len(walls)


def test_each_trajectory_is_a_tum_file_too(basin):
    """As evo takes them: time, x y z, quaternion x y z w."""
    table = np.genfromtxt(basin / "trajectory.csv", delimiter=",", names=True)
    tum = np.loadtxt(str(basin / "refined.tum"))
    assert tum.shape == (len(table), 8)
    assert np.allclose(tum[:, 0], table["time"])
    assert np.allclose(tum[:, 1], table["refined_x"], atol=1e-4)
    yaw = 2.0 * np.arctan2(tum[:, 6], tum[:, 7])
    assert np.allclose(np.cos(yaw - table["refined_yaw"]), 1.0)
    assert len(np.loadtxt(str(basin / "truth.tum"))) > 100


def test_what_it_found_is_what_another_run_knows_beforehand(basin, tmp_path):
    assert run(BASIN, "--out", tmp_path, "--parameters", basin / "live.yaml").returncode == 0
    first, second = (summary_of(one)["calibration"]["range_scale_error"] for one in (basin, tmp_path))
    assert second["deviation"] <= first["deviation"]
    assert abs(second["value"]) <= abs(first["value"]) + first["deviation"]


def test_a_recording_with_the_heading_alone_is_known_as_that_and_mapped(tmp_path):
    bag, folder = tmp_path / "heading.bag", tmp_path / "out"
    reduce_bag(BASIN, bag, odom_frame="odom", base_frame="base_link")
    done = run(bag, "--out", folder)
    assert done.returncode == 0, done.stderr
    assert "odometry: hovering, because the position never changes, the heading by" in done.stdout
    trajectory = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True)
    assert np.ptp(trajectory["odometry_x"]) == 0.0
    assert np.ptp(trajectory["corrected_x"]) > 1.0


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Return the folder of a run that is told its odometry and some parameters, and what it said."""
    folder = tmp_path_factory.mktemp("told")
    (folder / "mine.yaml").write_text("sonar_delay: 0.25\nfree_scans: 20\n")
    changes = ["--set", "range_scale=0.99", "--no-calibrate", "--odometry", "thrusters"]
    done = run(BASIN, "--out", folder / "out", "--parameters", folder / "mine.yaml", *changes)
    assert done.returncode == 0, done.stderr
    return folder / "out", done.stdout


def test_an_odometry_that_was_said_overrules_what_the_recording_looks_like(told):
    assert "odometry: thrusters, because --odometry or a parameter says so" in told[1]
    assert yaml.safe_load((told[0] / "live.yaml").read_text())["mlsm_core"]["odometry"] == "THRUSTERS"


def test_parameters_of_a_file_are_taken_and_held(told):
    cloud = yaml.safe_load((told[0] / "live.yaml").read_text())["sonar_to_cloud"]
    assert (cloud["sonar_delay"], cloud["range_scale"]) == pytest.approx((0.25, 0.99), abs=1e-6)


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """Return the folder of a run with the same recording twice."""
    folder = tmp_path_factory.mktemp("twice")
    done = run(BASIN, BASIN, "--out", folder, *(["--mcap"] if find_spec("mcap") else []))
    assert done.returncode == 0, done.stderr
    return folder


def test_a_second_recording_is_found_in_the_map_of_the_first_and_adds_to_it(twice):
    summary = summary_of(twice)
    (second,) = summary["sessions"]
    assert (second["found_after_scans"], second["matched"]) == (1, second["scans"] - 1)
    first, second = (np.loadtxt(str(twice / name), delimiter=",", skiprows=1) for name in TRAJECTORIES)
    assert np.hypot(*(first - second)[-20:, 4:6].T).max() < 0.5
    assert read_map(twice / "map.mlsm").shown.count.sum() > 1.8 * summary["scans"] * 50


def test_an_mcap_file_holds_the_mission_in_messages_that_bring_their_types(twice):
    reader = pytest.importorskip("mcap.reader")
    with (twice / "map.mcap").open("rb") as file:
        held = reader.make_reader(file).get_summary()
    kinds = {held.schemas[one.schema_id].name.replace("/msg/", "/") for one in held.channels.values()}
    assert kinds == {
        "sensor_msgs/PointCloud2", "nav_msgs/OccupancyGrid", "sensor_msgs/CompressedImage", "nav_msgs/Path",
        "nav_msgs/Odometry", "tf2_msgs/TFMessage", "diagnostic_msgs/DiagnosticArray",
    }  # fmt: skip
    assert {one.encoding for one in held.schemas.values()} == {"ros2msg"}
    with Bag(twice / "map.mcap") as bag:
        assert bag.topics["/scan"].count == summary_of(twice)["scans"]
        (blocks,) = [message for _, message in bag.messages("/map/blocks")]
        assert blocks.width == summary_of(twice)["blocks"]
        covariances = [message.pose.covariance[[0, 7]] for _, message in bag.messages("/pose")]
        assert np.all(np.array(covariances) > 0.0)
        (checks,) = [message for _, message in bag.messages("/checks")]
        is_ok, answer = checks.status[0].level == 0, RunAnswer(summary_of(twice)["answer"])
        assert is_ok == (answer is RunAnswer.FINE)


def test_the_report_shows_the_way_of_each_recording(twice):
    pytest.importorskip("plotly")
    assert "corrected, basin.bag" in (twice / "report.html").read_text()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["/no/such.bag"], "map_bag: /no/such.bag: No such file or directory"),
        ([BASIN, "--set", "echo_deviation=30"], "map_bag: echo_deviation = 30: must be a number from 0.01 to 10 m"),
        ([BASIN, "--set", "no_such=1"], "no_such = 1: no such parameter"),
        ([BASIN, "--truth", "/gps"], "no topic /gps"),
        ([BASIN, "--truth", "/gps"], "/ground_truth"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(words, reason, tmp_path):
    assert reason in refused(*words, "--out", tmp_path / "out")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ([BASIN, BASIN, "--refine"], "--refine fits one recording"),
        ([BASIN, "--check"], "--check repeats the fit of --refine"),
    ],
)
def test_options_that_contradict_each_other_are_refused(words, reason, tmp_path):
    done = run(*words, "--out", tmp_path)
    assert (done.returncode, reason in done.stderr) == (2, True)


def test_a_missing_further_bag_is_named_before_the_first_is_mapped(tmp_path):
    out = tmp_path / "out"
    assert refused(BASIN, "/no/such.bag", "--out", out) == "map_bag: /no/such.bag: No such file or directory"
    assert not out.exists()


def test_an_empty_bag_is_refused(tmp_path):
    rosbag.Bag(str(tmp_path / "empty.bag"), "w").close()
    assert "there are none at all" in refused(tmp_path / "empty.bag", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_bag_with_nothing_but_beams_is_mapped_and_says_what_is_missing(tmp_path):
    with rosbag.Bag(str(BASIN)) as whole, rosbag.Bag(str(tmp_path / "beams.bag"), "w") as beams:
        for topic, message, stamp in whole.read_messages(topics=["/sonar/raw"]):
            beams.write(topic, message, stamp)
    done = run(tmp_path / "beams.bag", "--out", tmp_path / "out")
    assert (done.returncode, "nothing says where the vehicle was" in done.stderr) == (0, True), done.stderr
    assert summary_of(tmp_path / "out")["scans"] > 0


def test_an_output_folder_that_is_a_file_is_refused(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    assert refused(BASIN, "--out", file) == f"map_bag: {file}: is a file, must be a folder"


def test_a_further_recording_that_cannot_be_read_is_told_by_its_path(tmp_path):
    broken = tmp_path / "no.bag"
    broken.write_bytes(b"no bag")
    assert refused(BASIN, broken, "--out", tmp_path).startswith(f"map_bag: {broken}: ")
