"""What map_bag refuses, in one line each."""

import pytest
import rosbag
from map_bag_runs import BASIN, refused, run

from mlsm_manager.offline import sessions

pytestmark = pytest.mark.long

# map_bag runs as a process of its own here, so that its import of a compiled module of ROS does not show.
pytest.importorskip("tf2_py")


def test_a_missing_bag_is_named(tmp_path):
    assert refused("/no/such.bag", "--out", tmp_path) == "map_bag: /no/such.bag: No such file or directory"


def test_a_missing_further_bag_is_named_before_the_first_is_mapped(tmp_path):
    out = tmp_path / "out"
    assert refused(BASIN, "/no/such.bag", "--out", out) == "map_bag: /no/such.bag: No such file or directory"
    assert not out.exists()


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


def test_several_recordings_are_not_refined(tmp_path):
    done = run(BASIN, BASIN, "--out", tmp_path, "--refine")
    assert (done.returncode, "--refine fits one recording" in done.stderr) == (2, True)


def test_further_fits_need_the_first_one(tmp_path):
    done = run(BASIN, "--out", tmp_path, "--check")
    assert (done.returncode, "--check repeats the fit of --refine" in done.stderr) == (2, True)


def test_an_output_folder_that_is_a_file_is_refused(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    assert refused(BASIN, "--out", file) == f"map_bag: {file}: is a file, must be a folder"


def test_a_further_recording_that_cannot_be_read_is_told_by_its_path(tmp_path):
    broken = tmp_path / "no.bag"
    broken.write_bytes(b"no bag")
    assert refused(BASIN, broken, "--out", tmp_path).startswith(f"map_bag: {broken}: ")


def test_a_cluster_that_is_not_there_is_told_in_one_line(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(sessions, "CLUSTER_TIMEOUT", 0.5)
    line = refused(BASIN, BASIN, "--out", tmp_path, "--scheduler", "tcp://127.0.0.1:9")
    assert line.startswith("map_bag: --scheduler tcp://127.0.0.1:9: ")
