"""Messages of several sonars become the same beams; damaged ones crash nothing, and each is counted."""

import math

import numpy as np
import pytest
from fuzzed_beams import fuzz
from hypothesis import given
from hypothesis import strategies as st
from programs import ROOT
from sonar_messages import (
    SECOND,
    STAMP_NS,
    header,
    laser_scan_of,
    micron_line_of,
    ping_360_of,
    point_cloud_of,
    projected_sonar_image_of,
    raw_sonar_image_of,
    scan_line_of,
    sonar_echo_of,
    sonar_image_data_of,
    turning_image_of,
)

from node_support.errors import RefusedInput
from sonar_processing.beams.beam_types import BEAM_TYPES, IMAGE, LASER_SCAN, OWN, POINT_CLOUD
from sonar_processing.beams.reader import BeamMessageParameters, BeamReader

ECHO, PING_360 = "ping360_sonar/SonarEcho", "bluerobotics_sonar_msgs/SonarPing360"
MICRON = "micron_driver_ros/ScanLine"
RAW, PROJECTED = "marine_acoustic_msgs/RawSonarImage", "marine_acoustic_msgs/ProjectedSonarImage"
MADE = {
    OWN: scan_line_of,
    ECHO: sonar_echo_of,
    PING_360: ping_360_of,
    MICRON: micron_line_of,
    POINT_CLOUD: point_cloud_of,
    LASER_SCAN: laser_scan_of,
    RAW: raw_sonar_image_of,
    PROJECTED: projected_sonar_image_of,
}
SONARS_PAGE = (ROOT / "docs/sonars.md").read_text()
NEEDED = {
    OWN: "header angle intensities maxrange_meters range_resolution sensorAngle",
    ECHO: "header angle intensities range number_of_samples speed_of_sound",
    PING_360: "header angle profile_data range",
    MICRON: "header angle bin_distance_step bins",
    POINT_CLOUD: "header points channels",
    LASER_SCAN: "header angle_min angle_increment time_increment range_max ranges",
    RAW: "header ping_info sample_rate sample0 rx_angles image",
    PROJECTED: "header beam_directions ranges image",
}
MESSAGES = 5000


def reading(kind, message, **parameters):
    return BeamReader(BeamMessageParameters(**parameters)).read(kind, message)


def beam(kind, message, **parameters):
    return reading(kind, message, **parameters).beams[0]


def echoes_at(angles, **parameters):
    """Return what is read of one SonarEcho after the other."""
    reader = BeamReader(BeamMessageParameters(**parameters))
    return [reader.read(ECHO, sonar_echo_of(angle)) for angle in angles]


@pytest.mark.parametrize(
    ("kind", "message", "frame", "angle", "resolution", "strengths"),
    [
        (OWN, scan_line_of(), "sonar", 0.5, 0.25, [1, 2, 255]),
        ("avora_msgs/SonarScanLine", scan_line_of(intensities=[1, 2, 255]), "sonar", 0.5, 0.25, [1, 2, 255]),
        (ECHO, sonar_echo_of(0.5), "sonar_frame", 0.5, 5.0, [0, 10, 200, 3]),
        *((PING_360, ping_360_of(100 * n), "ping360", (2 - n) * math.pi / 2, 0.5, [5, 6, 7, 8]) for n in (1, 2, 3)),
        (MICRON, micron_line_of(-90.0), "Micron", -math.pi / 2, 0.05, [1, 2, 3]),
        (POINT_CLOUD, point_cloud_of(bearing=2.0), "sonar", 2.0, 0.05, [1, 2, 3]),
        (RAW, raw_sonar_image_of(2.0), "sonar", 2.0, 0.05, [0, 1, 2, 3]),
        (PROJECTED, projected_sonar_image_of(2.0), "sonar", 2.0, 0.05, [0, 1, 2, 3]),
    ],
)
def test_a_message_becomes_the_beam_that_it_holds(kind, message, frame, angle, resolution, strengths):
    found = beam(kind, message)
    assert (found.frame_id, found.intensities.tolist()) == (frame, strengths)
    assert (found.angle, found.range_resolution) == (pytest.approx(angle), pytest.approx(resolution))


def test_our_own_message_tells_the_tilt():
    assert beam(OWN, scan_line_of()).sensor_angle == -0.125


@pytest.mark.parametrize("maxrange", [0.0, -1.0, math.nan])
def test_our_own_message_needs_a_range(maxrange):
    with pytest.raises(RefusedInput, match="maxrange_meters"):
        reading(OWN, scan_line_of(maxrange_meters=maxrange))


def test_a_cloud_that_is_no_single_beam_is_refused():
    bent = point_cloud_of()
    bent.points[1].x += 0.01
    for cloud in (bent, point_cloud_of(channels=[]), point_cloud_of(points=[])):
        with pytest.raises(RefusedInput, match="must be one beam"):
            reading(POINT_CLOUD, cloud)


@pytest.mark.parametrize("kind", [RAW, PROJECTED])
@pytest.mark.parametrize("image", [{"beam_count": 2}, {"dtype": 8}, {"strengths": ()}])
def test_a_picture_of_several_beams_or_without_strengths_is_refused(kind, image):
    with pytest.raises(RefusedInput):
        reading(kind, MADE[kind](image=sonar_image_data_of(**image), sample0=0))


def test_strengths_of_two_bytes_give_their_higher_one():
    image = sonar_image_data_of((9, 1, 9, 2, 9, 3), dtype=2)
    assert beam(RAW, raw_sonar_image_of(image=image)).intensities.tolist() == [0, 1, 2, 3]


def test_the_column_that_is_new_in_an_image_of_a_turn_is_the_beam():
    reader = BeamReader(BeamMessageParameters(image_range=30.0))
    with pytest.raises(RefusedInput, match="first image"):
        reader.read(IMAGE, turning_image_of({3: (1, 2, 3)}))
    columns = {3: (1, 2, 3), 4: (7, 8, 9)}
    (ahead,) = reader.read(IMAGE, turning_image_of(columns)).beams
    assert (ahead.angle % (2 * math.pi), ahead.range_resolution) == (pytest.approx(0.0), 10.0)
    assert ahead.intensities.tolist() == [7, 8, 9]
    (unchanged,) = reader.read(IMAGE, turning_image_of(columns)).beams
    assert unchanged.angle == pytest.approx(-math.pi / 4)
    with pytest.raises(RefusedInput, match="image_range"):
        reading(IMAGE, turning_image_of())


@pytest.mark.parametrize("ros_2_name", ["ping360_sonar_msgs/msg/SonarEcho", "micron_driver_ros/msg/ScanLine"])
def test_types_are_known_by_their_names_in_ros_2(ros_2_name):
    made = sonar_echo_of if "Echo" in ros_2_name else micron_line_of
    assert beam(ros_2_name, made(header=header(as_rosbags=True))).intensities.size


@pytest.mark.parametrize(("kind", "seconds"), [(ECHO, 40 / 1480), (PING_360, 4 / 1500), (MICRON, 0.3 / 1500)])
def test_a_stamp_taken_after_the_reply_goes_back_to_the_ping(kind, seconds):
    assert beam(kind, MADE[kind]()).stamp_ns == pytest.approx(STAMP_NS - seconds * SECOND, abs=1)


@pytest.mark.parametrize("kind", [OWN, RAW, PROJECTED])
def test_a_stamp_of_the_ping_stays(kind):
    assert beam(kind, MADE[kind]()).stamp_ns == STAMP_NS


def test_a_laser_scan_becomes_one_beam_per_ray_with_one_echo():
    found = reading(LASER_SCAN, laser_scan_of((1.0, math.inf, 3.0, math.nan)))
    assert [one.angle for one in found.beams] == [-1.0, -0.5, 0.0, 0.5]
    assert [one.stamp_ns - STAMP_NS for one in found.beams] == [0, SECOND // 10, 2 * SECOND // 10, 3 * SECOND // 10]
    assert [one.ranges[one.intensities > 0].tolist() for one in found.beams] == [
        [pytest.approx(1.05)], [], [pytest.approx(3.05)], [],
    ]  # fmt: skip


def test_a_laser_scan_is_taken_with_a_warning():
    assert "time_increment" in reading(LASER_SCAN, laser_scan_of()).notes[1]


@pytest.mark.parametrize("angles", [[0.0, 200.0], [399.0], [37.0, 38.0], [6.5], [0.0, 1.0, 2.0]])
def test_gradians_where_radians_are_documented_are_told_by_their_values(angles):
    found = echoes_at(angles)[-1]
    assert found.beams[0].angle == pytest.approx(angles[-1] * math.pi / 200.0)
    assert "gradians, told by their values" in " ".join(found.notes) or len(angles) > 1


@given(st.lists(st.integers(-200, 199).filter(bool), min_size=1, max_size=60))
def test_radians_stay_radians(steps):
    angles = [step * 2.0 * math.pi / 400.0 for step in steps]
    assert [one.beams[0].angle for one in echoes_at(angles)] == angles


@given(st.integers(0, 399), st.integers(1, 10))
def test_a_driver_of_gradians_is_understood_from_its_first_beam_on(first, step):
    angles = [float((first + step * number) % 400) for number in range(60)]
    expected = [angle * math.pi / 200.0 for angle in angles]
    np.testing.assert_allclose([one.beams[0].angle for one in echoes_at(angles)], expected)


def test_an_angle_of_0_does_not_tell_the_unit_and_needs_none():
    found = echoes_at([0.0, 0.0, 2.0, 4.0])
    assert [one.beams[0].angle for one in found[:2]] == [0.0, 0.0]
    assert [len(one.notes) for one in found] == [0, 0, 1, 0]
    assert not any(one.unit_changed for one in found)


def test_a_single_broken_angle_does_not_change_the_unit():
    angles = [0.1 * number for number in range(1, 9)]
    found = echoes_at([*angles, 390.0, 0.9])
    assert found[-1].beams[0].angle == 0.9
    assert not any(one.unit_changed for one in found)


def test_a_unit_that_turns_out_to_be_another_is_told():
    found = echoes_at([390.5, *(0.01 * number for number in range(1, 4))])
    assert [one.unit_changed for one in found] == [False, False, True, False]
    assert "radians" in found[2].notes[0]


@pytest.mark.parametrize(("unit", "angle"), [("GRADIANS", math.pi / 2), ("DEGREES", math.pi / 1.8), ("RADIANS", 100.0)])
def test_a_unit_that_is_set_is_taken_and_not_said_to_be_told_by_values(unit, angle):
    found = reading(ECHO, sonar_echo_of(100.0), angle_unit=unit)
    assert found.beams[0].angle == pytest.approx(angle)
    assert "told by" not in found.notes[0]


@pytest.mark.parametrize(("turns", "sign"), [("CLOCKWISE", -1), ("COUNTER_CLOCKWISE", 1)])
def test_the_direction_can_be_set(turns, sign):
    assert beam(MICRON, micron_line_of(90.0), head_turns=turns).angle == pytest.approx(sign * math.pi / 2)


def test_what_is_assumed_of_a_type_is_said_once():
    reader = BeamReader(BeamMessageParameters())
    assert "degrees" in reader.read(MICRON, micron_line_of()).notes[0]
    assert reader.read(MICRON, micron_line_of()).notes == []
    assert reader.read(OWN, scan_line_of()).notes == []


def test_a_type_that_is_no_beam_is_refused_with_those_that_are():
    with pytest.raises(RefusedInput, match=r"nav_msgs/Odometry.*ping360_sonar/SonarEcho") as refused:
        reading("nav_msgs/Odometry", object())
    assert refused.value.kind == "messages of unknown types"


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in NEEDED for name in NEEDED[kind].split()])
def test_a_message_without_a_field_is_refused_by_the_name_of_the_field(kind, name):
    message = MADE[kind]()
    delattr(message, name)
    with pytest.raises(RefusedInput, match=name):
        reading(kind, message)


@pytest.mark.parametrize(
    ("kind", "field", "values"),
    [
        (ECHO, "range", [0]),
        (ECHO, "intensities", [b""]),
        (ECHO, "angle", [math.nan]),
        (PING_360, "profile_data", [[]]),
        (PING_360, "range", [math.inf, -1.0]),
        (MICRON, "bins", [[], None]),
        (MICRON, "bin_distance_step", [math.nan]),
        (MICRON, "header", [header(frame_id=""), header(0), header(2**31 * SECOND), header(frame_id="/")]),
        (LASER_SCAN, "range_max", [0.0, math.nan]),
        (LASER_SCAN, "time_increment", [math.inf]),
        (LASER_SCAN, "angle_increment", [math.nan]),
        (LASER_SCAN, "ranges", [[], np.ones(10000)]),
    ],
)
def test_a_message_that_makes_no_beam_is_refused(kind, field, values):
    for value in values:
        with pytest.raises(RefusedInput):
            reading(kind, MADE[kind](**{field: value}))


@pytest.mark.parametrize("name", sorted(BEAM_TYPES))
def test_the_page_of_sonars_says_of_every_type_what_the_table_does(name):
    kind = BEAM_TYPES[name]
    (row,) = [line for line in SONARS_PAGE.splitlines() if line.startswith("|") and f"`{name}`" in line]
    way = "clockwise" if kind.clockwise else "counter-clockwise"
    for words in (kind.unit.value.lower(), f"| {way} |"):
        assert words in row


# genpy warns of names that are no UTF-8, and its generated code writes arrays with the old name of tobytes.
@pytest.mark.filterwarnings("ignore")
def test_no_damaged_message_crashes_and_each_is_counted():
    fuzzer = fuzz(MESSAGES, seed=2)
    assert fuzzer.crashes == []
    assert sum(fuzzer.outcomes.values()) == MESSAGES
    assert set(fuzzer.outcomes) >= {"taken", "beams refused", "stamps refused", "messages not readable"}


def test_a_laser_scan_whose_rays_all_point_one_way_is_one_beam():
    scan = laser_scan_of(np.arange(1, 5) * 0.5, angle_increment=0.0, angle_min=0.7, intensities=[0.0, 300.0, 20.0, 3.0])
    (found,) = reading(LASER_SCAN, scan).beams
    assert (found.angle, found.range_resolution) == (0.7, 0.5)
    assert found.intensities.tolist() == [0, 255, 20, 3]


@pytest.mark.parametrize(
    ("ranges", "intensities"), [((0.5, 1.0), []), ((1.0, 0.5), [1, 2]), ((0.1, 1.0, 1.1), [1, 2, 3])]
)
def test_rays_that_all_point_one_way_and_are_no_bins_are_refused_at_once(ranges, intensities):
    with pytest.raises(RefusedInput, match="grow evenly"):
        reading(LASER_SCAN, laser_scan_of(ranges, angle_increment=0.0, intensities=intensities))
