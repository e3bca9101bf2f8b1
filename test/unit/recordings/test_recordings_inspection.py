"""--inspect says what a foreign bag holds, what is assumed and what is missing; convert_bag makes one of ours of it."""

import foreign_bag as foreign
import numpy as np
import pytest
from made_bags import write_mcap
from programs import BASIN

from mlsm_manager.offline.recording import read_recording
from recordings.bags.bag import RecordingError
from recordings.bags.messages import Placing
from recordings.bags.topic_roles import Role
from recordings.convert_bag import convert_bag
from recordings.reader import Request
from recordings.survey import report, survey


@pytest.fixture
def foreign_bag(tmp_path):
    with foreign.of_beams(tmp_path / "their run.bag", topic="/sonar360/echo") as bag:
        foreign.add_imu(bag, gravity=-9.8)
        foreign.add_odometry(bag)
        foreign.add_poses(bag, "/gps/pose")
        foreign.add_fixed(bag, "hull_ned", "head")
    return tmp_path / "their run.bag"


def test_topics_are_listed_by_what_they_are_good_for(foreign_bag):
    topics = survey(foreign_bag, Request()).topics
    names = {role: [topic.name for topic in found] for role, found in topics.items()}
    assert names[Role.BEAMS] == ["/sonar360/echo"]
    assert names[Role.ODOMETRY] == ["/nav/odometry"]
    assert names[Role.HEADING] == ["/imu/data"]
    assert names[Role.POSITION] == ["/gps/pose"]


def test_frames_signs_of_z_down_and_assumptions_are_told(foreign_bag):
    told = report(survey(foreign_bag, Request()), Request())
    for part in (
        "hull_ned -> head: fixed",
        "hull_ned: named so",
        "/imu/data feels gravity along -z, -9.8 m/s2",
        "odometry from /nav/odometry",
        "tf does not place head on the vehicle",
        "give --ned",
        "200 beams in 10.0 s",
        f"rosrun underwater_map_construction map_bag '{foreign_bag}' --out 'their run_map' --refine",
    ):
        assert part in told


def test_a_bag_of_ours_lacks_and_assumes_nothing():
    told = survey(BASIN, Request())
    assert (told.missing, told.assumed, told.z_down) == ([], [], [])


def test_what_is_missing_stands_in_place_of_a_command(tmp_path):
    with foreign.written(tmp_path / "a.bag") as bag:
        foreign.add_poses(bag, "/goal")
    told = report(survey(tmp_path / "a.bag", Request()), Request())
    assert "no topic holds beams" in told
    assert "start with" not in told


@pytest.mark.parametrize("ending", [".bag", ".mcap"])
def test_a_converted_bag_holds_the_same_recording(tmp_path, ending):
    ros2, out = write_mcap(BASIN, tmp_path / "basin.mcap"), tmp_path / f"out{ending}"
    told = convert_bag([str(ros2), str(out), "--truth", "/ground_truth"])
    assert told == f"{out}: 1202 beams; motion: poses"
    before = read_recording(BASIN, Request(truth="/ground_truth"))
    after = read_recording(out, Request(truth="/ground_truth"))
    np.testing.assert_allclose(after.track.poses, before.track.poses, rtol=0.0, atol=1e-9)
    assert np.array_equal(after.truth.positions, before.truth.positions)
    for one, other in zip(after.beams, before.beams):
        assert np.allclose(one.T_target_sonar, other.T_target_sonar, atol=1e-12)
        assert np.array_equal(one.beam.intensities, other.beam.intensities)


def test_a_foreign_bag_is_converted_with_its_odometry_and_mount(foreign_bag, tmp_path):
    convert_bag([str(foreign_bag), str(tmp_path / "out.bag"), "--set", "mount_x=1.5"])
    recording = read_recording(tmp_path / "out.bag", Request())
    assert (recording.notes, len(recording.beams)) == ([], foreign.BEAMS)
    assert recording.beams[0].T_target_sonar[0, 3] == pytest.approx(1.5)


def test_a_stamp_that_no_bag_can_hold_is_refused_in_one_line(tmp_path):
    damaged, out = tmp_path / "damaged.bag", tmp_path / "out.bag"
    with foreign.of_beams(damaged) as bag:
        still = Placing(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        for seconds in (foreign.START, -5.0):
            transform = bag.transform(still, bag.time(foreign.nanoseconds(seconds)), "odom", "base_link")
            bag.write("/tf", bag.transforms([transform]), foreign.nanoseconds(foreign.END))
        foreign.add_fixed(bag, "base_link", "head")
    with pytest.raises(RecordingError, match="stamps from -5000000000 to 110000000000 ns, must be from 0 to"):
        convert_bag([str(damaged), str(out)])
    assert not out.exists()


def test_nothing_is_left_of_a_conversion_that_failed(tmp_path):
    with pytest.raises(RecordingError):
        convert_bag(["/no/such.bag", str(tmp_path / "out.bag")])
    assert list(tmp_path.iterdir()) == []


def test_a_recording_is_not_converted_into_itself(tmp_path):
    recording = tmp_path / "x.bag"
    recording.write_bytes(BASIN.read_bytes())
    with pytest.raises(OSError, match="is read too"):
        convert_bag([str(recording), str(recording), "--overwrite"])
    assert recording.read_bytes() == BASIN.read_bytes()
