"""Bags of every kind give the same messages, and damaged ones one line."""

import gzip
import shutil
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from made_bags import write_mcap, write_ros1_bag, write_sqlite_bag
from old_bag import with_old_types
from programs import BASIN

from mlsm_manager.offline.recording import read_recording
from recordings.bags.bag import Bag, RecordingError
from recordings.bags.writers import COMPRESSIONS, BagWriter
from recordings.reader import Request

NAMES = Request(truth="/ground_truth")


@pytest.fixture(scope="module")
def expected():
    return read_recording(BASIN, NAMES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_sqlite_bag(BASIN, tmp_path_factory.mktemp("ros2") / "basin")


@pytest.fixture(scope="module", params=["folder", "sqlite", "mcap"])
def ros2_bag(request, folder, tmp_path_factory):
    if request.param == "folder":
        return folder
    home = tmp_path_factory.mktemp("lone")
    if request.param == "mcap":
        return write_mcap(BASIN, home / "basin.mcap")
    (database,) = folder.glob("*.db3")
    return Path(shutil.copy(str(database), str(home)))


def assert_same(recording, expected):
    assert [one.beam.stamp_ns for one in recording.beams] == [one.beam.stamp_ns for one in expected.beams]
    for one, other in zip(recording.beams, expected.beams):
        np.testing.assert_allclose(one.T_target_sonar, other.T_target_sonar, rtol=0.0, atol=1e-9)
        assert np.array_equal(one.beam.intensities, other.beam.intensities)
        assert (one.beam.angle, one.is_moving) == (other.beam.angle, other.is_moving)
    np.testing.assert_allclose(recording.track.poses, expected.track.poses, rtol=0.0, atol=1e-9)
    assert np.array_equal(recording.truth.positions, expected.truth.positions)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_what_is_written_is_read_again(tmp_path, compression):
    copy = tmp_path / "copy.bag"
    with Bag(BASIN) as bag, BagWriter(copy, compression) as writer:
        for topic in ("/tf", "/sonar/raw"):
            for stamp, message in islice(bag.messages(topic), 60):
                writer.write(topic, message, stamp)
    with Bag(BASIN) as bag, Bag(copy) as written:
        assert set(written.topics) == {"/tf", "/sonar/raw"}
        for topic in written.topics:
            expected = islice(bag.messages(topic), 60)
            assert [(time, repr(one)) for time, one in written.messages(topic)] == [
                (time, repr(one)) for time, one in expected
            ]


@pytest.mark.long
def test_a_bag_of_2015_gives_what_the_same_bag_of_today_gives(tmp_path, expected):
    with_old_types(BASIN, tmp_path / "old.bag")
    assert_same(read_recording(tmp_path / "old.bag", NAMES), expected)


def test_a_ros2_bag_gives_what_the_ros1_bag_gives(ros2_bag, expected):
    assert_same(read_recording(ros2_bag, NAMES), expected)
    with Bag(BASIN) as ros1, Bag(ros2_bag) as ros2:
        assert ros2.topics == ros1.topics
        assert (ros1.is_ros2, ros2.is_ros2) == (False, True)


def test_a_bag_without_definitions_is_read_with_those_of_its_distribution(folder, tmp_path, expected):
    """ROS 2 before Iron writes none."""
    sqlite3 = pytest.importorskip("sqlite3")
    (database,) = folder.glob("*.db3")
    old = tmp_path / "humble.db3"
    old.write_bytes(database.read_bytes())
    with sqlite3.connect(str(old)) as connection:
        connection.execute("DROP TABLE message_definitions")
        connection.execute("UPDATE schema SET schema_version = 3")
    assert_same(read_recording(old, NAMES), expected)


def test_an_absent_file_is_told_by_its_path():
    with pytest.raises(RecordingError, match=r"^/no/such\.bag: No such file or directory$"):
        Bag(Path("/no/such.bag"))


@pytest.mark.parametrize("name", ["empty.bag", "empty.mcap", "empty.db3"])
def test_an_empty_file_is_refused(name, tmp_path):
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(RecordingError, match="not a bag, or damaged"):
        Bag(tmp_path / name)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Return bags of each kind with transforms only, and room for damaged ones."""
    home = tmp_path_factory.mktemp("damaged")
    topics = {"/tf_static", "/sonar_simulator/settings"}
    (database,) = write_sqlite_bag(BASIN, home / "folder", topics).glob("*.db3")
    bag, mcap = write_ros1_bag(BASIN, home / "whole.bag", topics), write_mcap(BASIN, home / "whole.mcap", topics)
    return {".bag": bag, ".db3": database, ".mcap": mcap}, home


def refusal(path):
    """Return why a bag is refused, empty if all of it can be read."""
    try:
        with Bag(path) as bag:
            for topic in bag.topics:
                list(bag.messages(topic))
    except RecordingError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap"])
@given(
    cut=st.floats(min_value=0.0, max_value=1.0),
    changes=st.lists(st.tuples(st.floats(min_value=0.0, max_value=1.0, exclude_max=True), st.integers(0, 255))),
)
def test_a_damaged_file_is_read_or_refused_in_one_line(small, suffix, cut, changes):
    bags, home = small
    data = bytearray(bags[suffix].read_bytes())
    for place, value in changes:
        data[int(place * len(data))] = value
    damaged = home / f"damaged{suffix}"
    damaged.write_bytes(data[: int(cut * len(data))] if cut < 0.5 else data)
    assert "\n" not in refusal(damaged)


def test_a_folder_of_ros_2_jazzy_is_read(tmp_path):
    folder = write_sqlite_bag(BASIN, tmp_path / "jazzy")
    metadata = yaml.safe_load((folder / "metadata.yaml").read_text())
    information = metadata["rosbag2_bagfile_information"]
    information["version"] = 9
    for topic in information["topics_with_message_count"]:
        topic["topic_metadata"]["offered_qos_profiles"] = [{"history": "keep_last", "depth": 10}]
    (folder / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    with Bag(folder) as bag:
        assert sum(1 for _ in bag.messages("/sonar/raw")) == bag.topics["/sonar/raw"].count > 0


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a bag of each format, with its chunks as they were recorded."""
    home = tmp_path_factory.mktemp("whole")
    with Bag(BASIN) as bag:
        ros1 = write_ros1_bag(BASIN, home / "whole.bag", set(bag.topics))
    return {".bag": ros1, ".mcap": write_mcap(BASIN, home / "whole.mcap")}


def pings(path):
    """Return times and messages of the beams in a bag, and what is said of it."""
    with Bag(path) as bag:
        return [(time, repr(message)) for time, message in bag.messages("/sonar/raw")], bag.notes


@pytest.mark.parametrize("tail", [b"", bytes(4096)], ids=["cut", "filled with zeros"])
@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_recording_that_was_cut_off_is_read_up_to_there(whole, tmp_path, suffix, tail):
    data = whole[suffix].read_bytes()
    cut = tmp_path / f"cut{suffix}"
    cut.write_bytes(data[: int(0.7 * len(data))] + tail)
    (found, notes), (everything, _) = pings(cut), pings(whole[suffix])
    assert found == everything[: len(found)]
    assert 0.4 < len(found) / len(everything) < 0.8
    assert notes == ["the recording was cut off; it is read up to there"]


def test_a_bag_whose_index_was_never_written_is_read(tmp_path):
    cut = tmp_path / "basin.bag.active"
    data = bytearray(BASIN.read_bytes())
    start = data.index(b"index_pos=") + len(b"index_pos=")
    data[start : start + 8] = bytes(8)
    cut.write_bytes(data)
    assert pings(cut)[0] == pings(BASIN)[0]


def test_a_folder_without_metadata_is_read_file_by_file(whole, tmp_path):
    folder = tmp_path / "two_files"
    folder.mkdir()
    shutil.copy(str(whole[".mcap"]), str(folder / "run_2.mcap"))
    data = whole[".mcap"].read_bytes()
    (folder / "run_10.mcap").write_bytes(data[: int(0.7 * len(data))])
    found, notes = pings(folder)
    everything, first = pings(whole[".mcap"])[0], pings(folder / "run_10.mcap")[0]
    assert found == everything + first
    assert len(notes) == 1


def test_a_folder_whose_metadata_is_damaged_is_read(tmp_path, folder):
    copy = Path(shutil.copytree(str(folder), str(tmp_path / "copy")))
    (copy / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 9}")
    assert pings(copy)[0] == pings(folder)[0]


def test_what_is_no_recording_is_refused(whole, tmp_path):
    (tmp_path / "packed.bag.gz").write_bytes(gzip.compress(BASIN.read_bytes()))
    (tmp_path / "short.bag").write_bytes(whole[".bag"].read_bytes()[:10_000])
    (tmp_path / "folder").mkdir()
    said = {path.name: refusal(path) for path in tmp_path.iterdir()}
    assert "packed with gzip; unpack it first: gunzip --keep" in said["packed.bag.gz"]
    assert "the recording was cut off before its first chunk ended" in said["short.bag"]
    assert said["folder"].endswith("holds neither metadata.yaml nor a file .mcap or .db3")
