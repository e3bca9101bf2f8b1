"""What map_bag leaves in its folder."""

import json

import matplotlib.colors
import matplotlib.image
import numpy as np
import pytest
from made_blocks import blocks_of

from mlsm_manager.offline.recording import Recording, Truth
from mlsm_manager.offline.run_files import CORRECTED, ODOMETRY, Run, errors_of, trajectory_csv, write_run, write_summary
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.surface_map.map_file import Layer, StoredMap
from mlsm_manager.surface_map.ply_file import read_ply

TIMES = np.arange(4.0)
ODOMETRY_POSES = np.column_stack([TIMES, np.zeros(4), np.full(4, 4.0)])
TRACK = Track(TIMES, ODOMETRY_POSES)
STORED = StoredMap("map", {Layer.SHOWN: blocks_of([(-2.0, -1.0)])})
RUN = Run(TIMES, {ODOMETRY: ODOMETRY_POSES, CORRECTED: ODOMETRY_POSES + np.array([0, 0.5, 0])}, {}, STORED)
TRUTH = Truth(TIMES, np.column_stack([TIMES, np.zeros(4)]))


def test_the_table_has_time_and_pose_of_every_trajectory():
    header, first = trajectory_csv(RUN.times, RUN.poses).splitlines()[:2]
    assert header == "time,odometry_x,odometry_y,odometry_yaw,corrected_x,corrected_y,corrected_yaw"
    np.testing.assert_allclose(np.array(first.split(","), dtype=float), [0, 0, 0, -2.2832, 0, 0.5, -2.2832])


def test_map_table_and_picture_are_written(tmp_path):
    write_run(tmp_path / "new", "a bag", RUN, Recording([], 0, TRACK, TRUTH))
    trajectories = {"trajectory.csv", "dead_reckoning.tum", "corrected.tum", "truth.tum"}
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"map.mlsm", "map.ply", "map.png", *trajectories}
    assert len(read_ply(tmp_path / "new/map.ply")) == 1
    picture = matplotlib.image.imread(str(tmp_path / "new/map.png"))[..., :3]
    for color in ("#999999", "#1f5fa8", "#111111"):
        assert np.isclose(picture, matplotlib.colors.to_rgb(color), atol=0.01).all(axis=2).any(), color


def test_errors_are_told_for_every_trajectory_only_with_a_truth():
    assert errors_of(RUN, Recording([], 0, TRACK, None)) == {}
    found = errors_of(RUN, Recording([], 0, TRACK, TRUTH))
    assert found[ODOMETRY] == {"mean": 0.0, "sd": 0.0, "max": 0.0}
    assert set(found) == {ODOMETRY, CORRECTED}


def test_a_summary_that_cannot_be_written_leaves_the_old_one(tmp_path):
    write_summary(tmp_path, {"scans": 1})
    with pytest.raises(TypeError):
        write_summary(tmp_path, {"scans": object()})
    assert json.loads((tmp_path / "summary.json").read_text()) == {"scans": 1}
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]
