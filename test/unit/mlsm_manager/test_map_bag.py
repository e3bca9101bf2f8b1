"""map_bag as it is run: bags in, files, figures and one-line errors out."""

from importlib.util import find_spec

import numpy as np
import pytest
import yaml
from heading_only import reduce_bag
from map_bag_runs import BASIN, run, summary_of

from mlsm_manager.surface_map.map_file import Layer, read_map

pytestmark = pytest.mark.long

# map_bag runs as a process of its own here, so that its import of a compiled module of ROS does not show.
pytest.importorskip("tf2_py")

FILES = {
    "map.mlsm", "map.ply", "map.png", "trajectory.csv", "live.yaml", "summary.json",
    "dead_reckoning.tum", "corrected.tum", "refined.tum", "truth.tum",
    *(["report.html"] if find_spec("plotly") else []),
}  # fmt: skip


@pytest.fixture(scope="module")
def basin(tmp_path_factory):
    folder = tmp_path_factory.mktemp("basin")
    done = run(BASIN, "--out", folder, "--truth", "/ground_truth", "--refine", "--check")
    assert done.returncode == 0, done.stderr
    return folder


def test_a_simulated_bag_gives_all_files(basin):
    assert {path.name for path in basin.iterdir()} == FILES


def test_the_same_command_writes_the_same_bytes(basin, tmp_path):
    assert run(BASIN, "--out", tmp_path, "--truth", "/ground_truth", "--refine", "--check").returncode == 0
    for name in FILES - {"summary.json"}:
        assert (tmp_path / name).read_bytes() == (basin / name).read_bytes(), name


def test_the_summary_has_the_promised_keys(basin):
    summary = summary_of(basin)
    counts = {"scans", "matched", "rejected", "blocks", "seconds", "times_real_time"}
    assert counts <= set(summary)
    for name in ("dead_reckoning", "corrected", "refined"):
        assert set(summary[name]) == {"mean", "sd", "max"}
    assert summary["rejected"] == 0
    assert {"echoes", "calibration", "checks", "deviation_per_minute", "trust"} <= set(summary)


def test_fits_with_other_settings_and_from_another_start_are_among_the_checks(basin):
    checks = summary_of(basin)["checks"]
    assert not checks["spread over settings"]["fires"]
    assert not checks["second start"]["fires"]


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
    free = {tuple(cell) for cell in layers[Layer.FREE].cells.tolist()}
    walls = {tuple(cell) for cell in layers[Layer.SHOWN].cells.tolist()}
    passed = {tuple(cell) for cell in np.floor(vehicle / layers[Layer.FREE].resolution).astype(int).tolist()}
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
    first, second = summary_of(basin)["calibration"], summary_of(tmp_path)["calibration"]
    assert second["range_scale_error"]["deviation"] <= first["range_scale_error"]["deviation"]
    assert (
        abs(second["range_scale_error"]["value"])
        <= abs(first["range_scale_error"]["value"]) + first["range_scale_error"]["deviation"]
    )


def test_a_recording_with_the_heading_alone_is_known_as_that_and_mapped(tmp_path):
    bag, folder = tmp_path / "heading.bag", tmp_path / "out"
    reduce_bag(BASIN, bag, odom_frame="odom", base_frame="base_link")
    done = run(bag, "--out", folder)
    assert done.returncode == 0, done.stderr
    assert "odometry: heading, because the position never changes, the heading by" in done.stdout
    trajectory = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True)
    assert np.ptp(trajectory["odometry_x"]) == 0.0
    assert np.ptp(trajectory["corrected_x"]) > 1.0


@pytest.mark.newest_only("dear; the test above maps without reported positions with every version")
def test_an_odometry_that_was_said_overrules_what_the_recording_looks_like(tmp_path):
    done = run(BASIN, "--out", tmp_path, "--odometry", "thrusters")
    assert done.returncode == 0, done.stderr
    assert "odometry: thrusters, because --odometry or a parameter says so" in done.stdout
    assert yaml.safe_load((tmp_path / "live.yaml").read_text())["mlsm_core"]["odometry"] == "THRUSTERS"


def test_parameters_of_a_file_are_taken_and_held(tmp_path):
    (tmp_path / "mine.yaml").write_text("sonar_delay: 0.25\nmin_points: 20\n")
    changes = ["--set", "range_scale=0.99", "--no-calibrate"]
    done = run(BASIN, "--out", tmp_path / "out", "--parameters", tmp_path / "mine.yaml", *changes)
    assert done.returncode == 0, done.stderr
    cloud = yaml.safe_load((tmp_path / "out" / "live.yaml").read_text())["sonar_to_cloud"]
    assert (cloud["sonar_delay"], cloud["range_scale"]) == pytest.approx((0.25, 0.99), abs=1e-6)
