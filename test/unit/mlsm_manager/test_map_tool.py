"""map_tool's commands, as a user types them."""

import os
import subprocess
import sys

import pytest
from made_maps import random_map, stored_map
from programs import ROOT

from mlsm_manager.map_tool import run_map_tool
from mlsm_manager.surface_map.map_file import read_map, write_map
from mlsm_manager.surface_map.ply_file import write_ply


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


def test_a_ply_of_this_package_is_a_map_too(run, tmp_path):
    write_ply(tmp_path / "c.ply", random_map().blocks)
    assert f"{len(random_map())} blocks" in run("info c.ply")


def test_crop_keeps_what_lies_in_the_box(run, tmp_path):
    told = run("crop a.mlsm c.mlsm --low 0 0 --high 10 10")
    blocks = read_map(tmp_path / "c.mlsm").shown
    assert told == f"c.mlsm: {len(blocks)} blocks\n"
    assert 0 < len(blocks) < len(read_map(tmp_path / "a.mlsm").shown)


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
