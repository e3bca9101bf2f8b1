"""Temporary files of processes that were killed while they wrote, and where relative paths lead."""

import os
import signal
import subprocess
import sys
from contextlib import nullcontext

import pytest

from node_support.files import check_output, remove_abandoned_parts, ros_path, whole_file, write_whole

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


def _killed(writer):
    writer.send_signal(signal.SIGKILL)
    writer.wait()


def test_what_a_killed_process_left_goes_with_the_next_save(tmp_path, writer):
    _killed(writer)
    assert [os.stat(str(tmp_path / name)).st_size for name in os.listdir(str(tmp_path))] == [1000000]
    write_whole(tmp_path / "other.ply", b"whole")
    assert os.listdir(str(tmp_path)) == ["other.ply"]


def test_what_a_living_process_writes_stays(tmp_path, writer):
    write_whole(tmp_path / "other.ply", b"whole")
    assert len(os.listdir(str(tmp_path))) == 2
    _killed(writer)


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
    expected = pytest.raises(OSError, match=f"{reason}.*{name}") if reason else nullcontext()
    with expected:
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
        ("", "maps", "/robot/.ros/maps"),
        ("", "~/maps", "/robot/maps"),
        ("", "/maps", "/maps"),
        ("/data/ros", "maps", "/data/ros/maps"),
    ],
)
def test_relative_paths_lie_in_ros_home(monkeypatch, ros_home, path, whole):
    monkeypatch.setenv("HOME", "/robot")
    monkeypatch.delenv("ROS_HOME", raising=False)
    if ros_home:
        monkeypatch.setenv("ROS_HOME", ros_home)
    assert str(ros_path(path)) == whole
