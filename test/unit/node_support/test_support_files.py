"""Temporary files of processes that were killed while they wrote, and where relative paths lead."""

import errno
import os
import subprocess
import sys
from contextlib import nullcontext

import pytest

from node_support.files import check_output, remove_abandoned_parts, ros_path, whole_file, whole_folder, write_whole

WRITER = """
import sys, time
from pathlib import Path
from node_support.files import whole_file
with whole_file(Path(sys.argv[1])) as temporary:
    temporary.write_bytes(b"x" * 1000000)
    print("writing", flush=True)
    time.sleep(60.0)
"""


@pytest.fixture
def writer(tmp_path):
    """Yield a process that has written half of map.ply and waits."""
    command = [sys.executable, "-c", WRITER, str(tmp_path / "map.ply")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"writing\n"
        yield process
        process.kill()


def test_what_a_living_process_writes_stays_and_what_a_killed_one_left_goes_with_the_next_save(tmp_path, writer):
    write_whole(tmp_path / "other.ply", b"whole")
    assert sorted(path.stat().st_size for path in tmp_path.iterdir()) == [5, 1000000]
    writer.kill()
    writer.wait()
    assert len(os.listdir(str(tmp_path))) == 2
    write_whole(tmp_path / "other.ply", b"whole")
    assert os.listdir(str(tmp_path)) == ["other.ply"]


def test_two_at_once_in_one_process_do_not_disturb_each_other(tmp_path):
    with whole_file(tmp_path / "a") as first, whole_file(tmp_path / "b") as second:
        first.write_text("one")
        second.write_text("two")
    assert (tmp_path / "a").read_text() + (tmp_path / "b").read_text() == "onetwo"
    assert sorted(os.listdir(str(tmp_path))) == ["a", "b"]


@pytest.mark.parametrize(
    ("name", "overwrite", "reason"),
    [
        ("new.bag", False, None),
        ("old.bag", True, None),
        ("old.bag", False, "exists"),
        ("new.mcap", True, r"must end with \.bag"),
        ("read.bag", True, "is read too"),
        ("link.bag", True, "is read too"),
    ],
)
def test_no_program_writes_over_what_it_reads_or_unasked_over_what_exists(tmp_path, name, overwrite, reason):
    for existing in ("old.bag", "read.bag"):
        (tmp_path / existing).write_text("recorded")
    (tmp_path / "link.bag").symlink_to(tmp_path / "read.bag")
    with pytest.raises(OSError, match=f"{reason}.*{name}") if reason else nullcontext():
        check_output(tmp_path / name, [tmp_path / "read.bag"], overwrite, ".bag")


def test_a_full_disk_is_told_with_the_name_of_the_file(tmp_path):
    def fill(path):
        with whole_file(path) as part:
            part.unlink()
            part.symlink_to("/dev/full")
            part.write_bytes(b"more than fits")

    with pytest.raises(OSError, match=r"No space left.*whole\.bag"):
        fill(tmp_path / "whole.bag")


def test_other_hidden_files_stay(tmp_path):
    (tmp_path / ".map.ply.backup").write_text("mine")
    remove_abandoned_parts(tmp_path)
    assert os.listdir(str(tmp_path)) == [".map.ply.backup"]


@pytest.mark.parametrize(
    ("ros_home", "path", "whole"),
    [
        ({}, "maps", "/robot/.ros/maps"),
        ({}, "~/maps", "/robot/maps"),
        ({}, "/maps", "/maps"),
        ({"ROS_HOME": "/data/ros"}, "maps", "/data/ros/maps"),
    ],
)
def test_relative_paths_lie_in_ros_home(monkeypatch, ros_home, path, whole):
    monkeypatch.setattr(os, "environ", {"HOME": "/robot", **ros_home})
    assert str(ros_path(path)) == whole


def _files_in(folder):
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_a_run_that_cannot_write_its_last_file_leaves_none_and_the_older_ones_as_they_were(tmp_path):
    (tmp_path / "map.mlsm").write_text("old")

    def run():
        with whole_folder(tmp_path, []) as folder:
            write_whole(folder / "map.mlsm", b"new")
            write_whole(folder / "tiles/18/0.png", b"new")
            with whole_file(folder / "report.html"):
                raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))

    with pytest.raises(OSError, match=f"File too large: '{tmp_path}/report.html'"):
        run()
    assert _files_in(tmp_path) == {"map.mlsm": "old"}


def test_a_run_that_ends_well_leaves_all_its_files_and_those_that_it_did_not_make(tmp_path):
    (tmp_path / "map.mlsm").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    with whole_folder(tmp_path, []) as folder:
        write_whole(folder / "map.mlsm", b"new")
        write_whole(folder / "tiles/18/0.png", b"new")
    assert _files_in(tmp_path) == {"map.mlsm": "new", "notes.txt": "mine", "tiles/18/0.png": "new"}


def test_a_run_does_not_write_over_what_it_reads(tmp_path):
    motion = tmp_path / "trajectory.csv"
    motion.write_text("read")

    def run():
        with whole_folder(tmp_path, [motion]) as folder:
            write_whole(folder / "map.mlsm", b"new")
            write_whole(folder / "trajectory.csv", b"new")

    with pytest.raises(OSError, match=r"is read too.*trajectory\.csv"):
        run()
    assert _files_in(tmp_path) == {"trajectory.csv": "read"}
