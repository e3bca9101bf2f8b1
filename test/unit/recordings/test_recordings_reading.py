"""The motion is found wherever a recording has it, and what is missing is said at once."""

from functools import partial

import foreign_bag as foreign
import numpy as np
import pytest
from programs import BASIN

from imagenex_852_driver.log_file import LoggedPing, LogWriter
from imagenex_852_driver.reply import Reply, ReplyKind
from mlsm_manager.offline.recording import read_recording
from recordings.bags.bag import RecordingError
from recordings.convert_bag import convert_bag
from recordings.motion.vehicle_motion import MotionNames, MotionSource
from recordings.reader import ReadingParameters, Request, read
from recordings.survey import report, survey

LOCAL_POSITION = "/mavros/local_position/pose"
CSV = "time,x,y,yaw\n100,0,0,0\n105,2.5,0,0\n110,5,0,0\n"
COMPASS = CSV.replace("yaw", "Heading_deg").replace(",0\n", ",90\n")


def bag_with(folder, *adds):
    """Return the path of a bag with beams and what each of `adds` writes."""
    with foreign.of_beams(folder / "sonar.bag") as bag:
        for add in adds:
            add(bag)
    return folder / "sonar.bag"


@pytest.fixture
def sonar_bag(tmp_path):
    """Path of a bag with beams only."""
    return bag_with(tmp_path)


def assert_goes_ahead(recording):
    places = np.array([one.T_target_sonar[0, 3] for one in recording.beams])
    assert len(places) == foreign.BEAMS
    assert np.diff(places) == pytest.approx(foreign.SPEED * 10.0 / (foreign.BEAMS - 1), abs=1e-6)


@pytest.mark.parametrize("add", [foreign.add_odometry, partial(foreign.add_poses, topic=LOCAL_POSITION)])
def test_without_tf_the_odometry_comes_from_a_topic(tmp_path, add):
    recording = read_recording(bag_with(tmp_path, add), Request())
    assert_goes_ahead(recording)
    assert "because tf does not link odom and base_link" in recording.notes[0]


def test_the_mount_is_found_through_the_frame_of_the_odometry(tmp_path):
    mount = partial(foreign.add_fixed, parent="hull", child="head", x=2.0)
    recording = read_recording(bag_with(tmp_path, foreign.add_odometry, mount), Request())
    assert recording.beams[0].T_target_sonar[0, 3] == pytest.approx(2.0)


def test_a_mount_that_tf_does_not_tell_is_that_of_the_parameters(tmp_path):
    parameters = ReadingParameters(mount_x=1.5, upside_down=True)
    recording = read_recording(bag_with(tmp_path, foreign.add_odometry), Request(parameters=parameters))
    assert recording.beams[0].T_target_sonar[:3, 3] == pytest.approx([1.5, 0.0, 0.0])
    assert recording.beams[0].T_target_sonar[2, 2] == pytest.approx(-1.0)


@pytest.mark.parametrize("topic", ["/mavros/setpoint_position/local", "/goal", "/ground_truth/pose"])
def test_poses_that_are_no_odometry_are_not_taken_for_one(tmp_path, topic):
    motion = read(bag_with(tmp_path, partial(foreign.add_poses, topic=topic)), Request()).motion
    assert motion.source is MotionSource.UNSAID
    assert "nothing says where the vehicle was" in motion.notes[0]


def test_a_bag_in_which_something_else_moves_is_refused(tmp_path):
    bag = bag_with(tmp_path, partial(foreign.add_fixed, parent="earth", child="ship", topic="/tf"))
    with pytest.raises(RecordingError, match="tf does not say where the vehicle was"):
        read(bag, Request())


def test_a_topic_that_is_asked_for_goes_before_tf():
    names = MotionNames(odometry="/ground_truth")
    by_truth, by_tf = read_recording(BASIN, Request(motion=names)), read_recording(BASIN, Request())
    assert "odometry from /ground_truth" in by_truth.notes[0]
    # The truth ends a little before tf does.
    assert by_truth.track.times[-1] < by_tf.track.times[-1]


def test_with_an_imu_alone_the_heading_is_known(tmp_path):
    assert read(bag_with(tmp_path, foreign.add_imu), Request()).motion.source is MotionSource.HEADING


@pytest.mark.parametrize(
    "add",
    [foreign.add_velocities, partial(foreign.add_odometry, has_positions=False)],
    ids=["twists", "odometry without positions"],
)
def test_velocities_along_the_heading_of_an_imu_are_odometry(tmp_path, add):
    recording = read_recording(bag_with(tmp_path, foreign.add_imu, add), Request())
    assert_goes_ahead(recording)
    assert "along the heading of /imu/data" in recording.notes[0]


def test_velocities_are_along_the_axes_of_their_instrument_where_tf_places_it(tmp_path):
    velocities = partial(foreign.add_velocities, frame="dvl", y=0.1)
    mount = partial(foreign.add_fixed, parent="base_link", child="dvl", x=1.0)
    track = read_recording(bag_with(tmp_path, foreign.add_imu, velocities, mount), Request()).track
    assert track.poses[-1] == pytest.approx([10.0 * foreign.SPEED, 1.0, 0.0])


def test_velocities_without_a_heading_are_no_odometry(tmp_path):
    with pytest.raises(RecordingError, match="/dvl/twist holds velocities, but no topic holds a heading"):
        read(bag_with(tmp_path, foreign.add_velocities), Request())


def test_a_vehicle_that_is_declared_as_standing_needs_nothing(sonar_bag):
    recording = read_recording(sonar_bag, Request(motion=MotionNames(declared=MotionSource.STANDING)))
    assert all(np.array_equal(one.T_target_sonar, np.eye(4)) for one in recording.beams)


def test_everything_that_is_missing_is_said_at_once(tmp_path):
    with foreign.written(tmp_path / "a.bag") as bag:
        foreign.add_poses(bag, "/goal")
    with pytest.raises(RecordingError) as refused:
        read(tmp_path / "a.bag", Request(truth="/gps"))
    for part in ("no topic holds beams", "no topic /gps"):
        assert part in str(refused.value)


def test_a_topic_without_beams_is_refused_with_its_type():
    with pytest.raises(RecordingError, match="nav_msgs/Odometry is not read as beams"):
        read(BASIN, Request(beams="/odom"))


def test_the_motion_comes_from_a_second_bag(tmp_path, sonar_bag):
    with foreign.written(tmp_path / "vehicle.bag") as bag:
        foreign.add_odometry(bag)
    assert_goes_ahead(read_recording(sonar_bag, Request(vehicle=tmp_path / "vehicle.bag")))


@pytest.mark.parametrize("text", [CSV, CSV.replace(",", ";"), COMPASS])
def test_the_motion_comes_from_a_table(tmp_path, sonar_bag, text):
    (tmp_path / "vehicle.csv").write_text(text)
    recording = read_recording(sonar_bag, Request(vehicle=tmp_path / "vehicle.csv"))
    assert_goes_ahead(recording)
    assert recording.track.poses[:, 2] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("time,x,y\n1,2,3\n2,3,4\n", "has the known columns time, x, y; needs time, one of yaw, yaw_deg, heading_deg"),
        ("time,x,yaw\n1,2,3\n2,3,4\n", "both x and y or neither"),
        ("time,yaw\n1,2\n2,east\n", "line 3: yaw = 'east', must be a number"),
        ("time,yaw\n1,2\n", "1 rows; needs at least 2"),
        ("", "0 rows"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused_with_its_line(tmp_path, text, reason):
    (tmp_path / "vehicle.csv").write_text(text)
    with pytest.raises(RecordingError, match=reason):
        read(BASIN, Request(vehicle=tmp_path / "vehicle.csv"))


def test_clocks_that_differ_are_told_with_the_offset_that_mends_them(tmp_path):
    (tmp_path / "vehicle.csv").write_text(CSV)
    with foreign.of_beams(tmp_path / "sonar.bag", start=5000.0):
        pass
    with pytest.raises(RecordingError, match=r"no time in common; .* -4900\.000$"):
        read(tmp_path / "sonar.bag", Request(vehicle=tmp_path / "vehicle.csv"))
    recording = read_recording(tmp_path / "sonar.bag", Request(vehicle=tmp_path / "vehicle.csv", offset=-4900.0))
    assert_goes_ahead(recording)


@pytest.fixture
def log(tmp_path):
    """A .852 log of a head that turned once in 10 s."""
    path = tmp_path / "turn.852"
    writer = LogWriter(path)
    for index in range(100):
        reply = Reply(ReplyKind.IMX, max_range=10, echoes=bytes(252), head_position=200 + 24 * index)
        writer.write(LoggedPing(reply, stamp=1e9 + 0.1 * index))
    writer.close()
    return path


def test_a_sonars_log_is_mapped_with_a_table(log, tmp_path):
    (tmp_path / "vehicle.csv").write_text("time,yaw_deg\n0,0\n20,40\n")
    recording = read_recording(log, Request(vehicle=tmp_path / "vehicle.csv", offset=5.0 - 1e9))
    assert len(recording.beams) == 100
    turned = [np.arctan2(one.T_target_sonar[1, 0], one.T_target_sonar[0, 0]) for one in recording.beams]
    assert np.degrees(turned[0]) == pytest.approx(10.0, abs=1e-3)
    assert np.degrees(turned[-1]) == pytest.approx(29.8, abs=1e-3)


def test_a_sonars_log_alone_says_nothing_of_the_motion_and_is_not_converted(log, tmp_path):
    assert read(log, Request()).motion.source is MotionSource.UNSAID
    with pytest.raises(RecordingError, match="nothing says where the vehicle was"):
        convert_bag([str(log), str(tmp_path / "out.bag")])


def test_a_sonars_log_is_surveyed_with_a_command_that_maps_it(log):
    told = report(survey(log, Request()), Request())
    assert "100 beams in" in told
    assert f"map_bag {log} --out turn_map --refine" in told


def test_a_table_of_beams_may_change_its_bins_and_hold_damaged_rows(tmp_path):
    path = tmp_path / "beams.csv"
    path.write_text("time,angle_deg,range,bins\n1,90,3,1 2 3\n1.1,92,3,4,5\nx,0,3,1\n1.3,0,0,1\n1.4,-90,2,300 -1\n")
    found = read(path, Request()).recorded
    assert [beam.intensities.tolist() for beam in found.beams] == [[1, 2, 3], [4, 5], [255, 0]]
    assert [beam.range_resolution for beam in found.beams] == pytest.approx([1.0, 1.5, 1.0])
    assert found.beams[0].angle == pytest.approx(np.pi / 2)
    assert found.refused == 2
    assert "line 4" in found.notes[0]


def test_a_table_of_beams_names_the_columns_that_it_needs(tmp_path):
    (tmp_path / "beams.csv").write_text("time,bins,range\n1,2,3\n")
    with pytest.raises(RecordingError, match="needs time, angle, range and, last, bins"):
        read(tmp_path / "beams.csv", Request())
