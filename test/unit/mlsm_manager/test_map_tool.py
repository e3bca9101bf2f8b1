"""map_tool's commands, as a user types them, and what they do with maps: move, merge, crop and compare."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_maps import in_order, map_with, partition, random_points, stored_map
from programs import ROOT

from mlsm_manager.map_tool import run_map_tool
from mlsm_manager.surface_map.map_file import Layer, StoredMap, read_map, write_map
from mlsm_manager.surface_map.operations import LevelTransform, difference, merged, merged_blocks


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a call of map_tool in a folder with the maps a.mlsm and b.mlsm, which gives what it prints."""
    for seed, name in enumerate("ab"):
        write_map(tmp_path / f"{name}.mlsm", stored_map(10 * seed, count=500))
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)

    def call(line):
        monkeypatch.setattr(sys, "argv", ["map_tool", *line.split()])
        run_map_tool()
        return capsys.readouterr().out

    return call


def test_info_says_frame_blocks_extent_and_calibration(run):
    told = run("info a.mlsm b.mlsm")
    assert "a.mlsm: frame map, made 2017-07-14" in told
    assert "shown: " in told
    assert "blocks of 0.5 m, 500 points, x -10.0 to 10.0 m" in told
    assert "calibration: range_scale = 0.98" in told
    assert "b.mlsm" in told


def test_a_reader_that_stops_reading_ends_it_without_a_traceback(run, tmp_path):
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, str(ROOT / "nodes" / "map_tool"), "info", "a.mlsm"]
    ended = subprocess.run(command, cwd=str(tmp_path), stdout=write, stderr=subprocess.PIPE, timeout=120)
    os.close(write)
    assert (ended.returncode, ended.stderr) == (0, b"")


def test_view_writes_a_picture_where_there_is_no_screen(run, tmp_path):
    assert run("view a.mlsm") == "no screen; a.png written\n"
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_export_of_a_slice_has_less_in_it(run, tmp_path):
    run("export a.mlsm all.pgm")
    run("export a.mlsm slice.pgm --slice -1 1")
    assert (tmp_path / "all.pgm").read_bytes().count(b"\0") > (tmp_path / "slice.pgm").read_bytes().count(b"\0") > 0


def test_crop_keeps_what_lies_in_the_box(run, tmp_path):
    told = run("crop a.mlsm c.mlsm --low 0 0 --high 10 10")
    blocks = read_map(tmp_path / "c.mlsm").shown
    assert told == f"c.mlsm: {len(blocks)} blocks\n"
    assert 0 < len(blocks) < len(read_map(tmp_path / "a.mlsm").shown)
    assert (blocks.mean[:, :2] >= 0.0).all()


def test_merge_says_whether_it_is_exact(run, tmp_path):
    assert run("merge a.mlsm b.mlsm c.mlsm --transform 1.5 -2 0.3 90").endswith("exactly\n")
    assert run("merge a.mlsm b.mlsm d.mlsm --transform 0.1 0 0 0").endswith("to within a cell\n")
    assert read_map(tmp_path / "c.mlsm").shown.count.sum() == 1000


def test_diff_of_a_map_with_itself_is_nothing(run):
    told = run("diff a.mlsm a.mlsm")
    assert told.count("\n0 are in a.mlsm only") == 2


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("info no.mlsm", "no.mlsm: No such file"),
        ("export a.mlsm a.xyz", "must end with one of"),
        ("crop a.mlsm c.mlsm --low 0 0 --high 1 1 1", "must both be X Y"),
        ("crop a.mlsm c.mlsm --low 1 1 --high 2 0", "low must not be above high"),
        ("crop a.mlsm c.mlsm --low 90 90 --high 91 91", "the map has no blocks"),
        ("info broken.mlsm", "broken.mlsm: not a map of this package"),
        ("export a.mlsm no/such/place.ply", ""),
        ("export a.mlsm broken.mlsm", "broken.mlsm: exists; --overwrite replaces it"),
        ("merge a.mlsm a.mlsm a.mlsm --overwrite", "a.mlsm: is read too"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(run, tmp_path, line, reason):
    (tmp_path / "broken.mlsm").write_bytes(b"broken")
    if not reason:
        (tmp_path / "no").write_text("")
        reason = "Not a directory"
    with pytest.raises(SystemExit, match=f"^map_tool: .*({reason})") as end:
        run(line)
    assert "\n" not in str(end.value)


RESOLUTION = 0.5
seeds = st.integers(0, 2**31)


def _points_moved(points, T_new_old):
    result = points.copy()
    result[:, :2] = points[:, :2] @ T_new_old.rotation().T + (T_new_old.x, T_new_old.y)
    result[:, 2] += T_new_old.z
    return result


def _total(blocks):
    """Return number, mean and variance of all points of all blocks."""
    count = blocks.count.sum()
    mean = (blocks.mean * blocks.count[:, np.newaxis]).sum(axis=0) / count
    squares = (blocks.variance + (blocks.mean - mean) ** 2) * blocks.count[:, np.newaxis]
    return count, mean, squares.sum(axis=0) / count


@given(seeds, st.integers(-9, 9), st.integers(-9, 9), st.sampled_from([-2.0, 0.0, 0.25, 3.5]), st.integers(-3, 4))
def test_where_cells_align_merging_makes_the_map_of_all_points(seed, x, y, z, quarters):
    transform = LevelTransform(x * RESOLUTION, y * RESOLUTION, z, quarters * np.pi / 2.0)
    assert transform.keeps_cells(RESOLUTION)
    first, second = random_points(seed, 300, 2.0), random_points(seed + 1, 300, 2.0)
    # A 2 ** -20 m grid: moving it rounds nothing, so that no point changes its cell by rounding.
    first, second = (np.rint(points * 2**20) / 2**20 + 2.0**-22 for points in (first, second))
    expected = map_with(np.concatenate([first, _points_moved(second, transform)])).blocks
    blocks = merged_blocks(map_with(first).blocks, map_with(second).blocks, transform)
    assert partition(blocks) == partition(expected)
    blocks, expected = blocks.take(in_order(blocks)), expected.take(in_order(expected))
    np.testing.assert_allclose(blocks.mean, expected.mean, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(blocks.variance, expected.variance, rtol=1e-9, atol=1e-12)


@given(seeds, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9), st.floats(-np.pi, np.pi))
def test_where_cells_do_not_align_the_points_as_a_whole_keep_number_mean_height_and_strength(seed, x, y, z, yaw):
    transform = LevelTransform(x, y, z, yaw)
    first, second = random_points(seed, 200, 4.0), random_points(seed + 1, 200, 4.0)
    points = np.concatenate([first, _points_moved(second, transform)])
    blocks = merged_blocks(map_with(first).blocks, map_with(second).blocks, transform)
    count, mean, variance = _total(blocks)
    assert count == 400
    np.testing.assert_allclose(mean, points.mean(axis=0), rtol=1e-9, atol=1e-9)
    expected = points.var(axis=0)
    np.testing.assert_allclose(variance[2:], expected[2:], rtol=1e-9)
    np.testing.assert_allclose(variance[:2].sum(), expected[:2].sum(), rtol=1e-9)
    assert (blocks.bottom.min(), blocks.height.max()) == (points[:, 2].min(), points[:, 2].max())


def test_merged_maps_have_the_layers_of_both():
    shown, other = map_with(random_points(0, 50)).blocks, map_with(random_points(1, 50)).blocks
    first = StoredMap("map", {Layer.SHOWN: shown}, {"range_scale": 0.9})
    second = StoredMap("other", {Layer.SHOWN: other, Layer.FREE: other})
    both = merged(first, second, LevelTransform(x=100.0))
    assert (both.frame, both.calibration) == ("map", {"range_scale": 0.9})
    assert len(both.shown) == len(shown) + len(other)
    assert both.layers[Layer.FREE].mean[:, 0].min() > 80.0


def test_a_difference_is_told_by_place_and_height():
    first = map_with([[0.1, 0.1, 0.0, 1.0], [5.1, 0.1, 0.0, 1.0], [9.1, 0.1, 0.0, 1.0]]).blocks
    second = map_with([[0.1, 0.1, 0.3, 1.0], [5.1, 0.1, 2.0, 1.0], [9.1, 4.1, 0.0, 1.0]]).blocks
    result = difference(first, second)
    assert sorted(result.only_first.mean[:, 0]) == [5.1, 9.1]
    assert sorted(result.only_second.mean[:, 1]) == [0.1, 4.1]
    assert result.both.mean[:, 0].tolist() == [0.1]
    assert result.shift.tolist() == [0.3]


def test_all_of_a_map_is_new_to_an_empty_one():
    blocks = map_with(random_points(0, 50)).blocks
    result = difference(map_with([]).blocks, blocks)
    assert (len(result.only_first), len(result.only_second)) == (0, len(blocks))
