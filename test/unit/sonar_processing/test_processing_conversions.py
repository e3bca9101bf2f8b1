"""Messages become arrays and arrays messages, bit by bit."""

import math
from dataclasses import replace
from io import BytesIO

import genpy
import numpy as np
import pytest
from clouds import SECOND, cloud_of
from geometry_msgs.msg import Quaternion, Transform, Vector3
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as numpy_st
from sensor_msgs.msg import LaserScan, PointCloud2, PointField
from std_msgs.msg import Header

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix, quaternion_of
from node_support.ros.transforms import matrix_from_message
from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import (
    StampedIntensityCloudArrays,
    cloud_from_message,
    cloud_to_message,
    header,
    laser_scan_message,
    point_cloud,
    points_from_message,
)
from sonar_processing.scans.polar_scan import PlanarLaserScan
from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

# The generated message code of Noetic writes arrays with the old name of tobytes.
pytestmark = pytest.mark.filterwarnings("ignore:tostring:DeprecationWarning")

HOUR = 3600.0
STAMP_NS = 1_400_000_000 * SECOND + 123456789
ANY_BITS = numpy_st.arrays(np.uint32, st.tuples(st.integers(0, 20), st.just(4))).map(lambda bits: bits.view(np.float32))


def _sent(message, received_type):
    """Return the message as a subscriber of `received_type` gets it."""
    buff = BytesIO()
    message.serialize(buff)
    return received_type().deserialize(buff.getvalue())


def _message(rows):
    """Return a cloud whose points are laid out as the rows of a structured array."""
    kinds = {"<f4": PointField.FLOAT32, "<f8": PointField.FLOAT64, "<u2": PointField.UINT16}
    layout = [(name, offset, kinds[kind.str]) for name, (kind, offset) in rows.dtype.fields.items()]
    fields = [PointField(name, offset, kind, 1) for name, offset, kind in layout]
    step = rows.dtype.itemsize
    return PointCloud2(height=1, width=len(rows), fields=fields, point_step=step, data=rows.tobytes())


def test_beams_and_stamped_clouds_are_wire_compatible_with_the_thesis():
    assert SonarScanLine._md5sum == "1346c6cd80ae2dac7dcbb520edd4a933"
    assert StampedIntensityCloud._md5sum == "c3ca4a41dac2f83d11677f1e54b81024"


@given(st.integers(0, 2**32 * SECOND - 1))
def test_a_header_holds_every_stamp_exactly(stamp_ns):
    assert header(stamp_ns, "sonar").stamp.to_nsec() == stamp_ns


@given(ANY_BITS, st.data())
def test_a_cloud_comes_back_from_its_message_bit_by_bit(points, data):
    seconds = STAMP_NS * 1e-9
    times = st.floats(seconds - HOUR, seconds + HOUR) | st.floats(-seconds - HOUR, -seconds + HOUR) | st.just(np.nan)
    stamps = data.draw(numpy_st.arrays(np.float64, len(points), elements=times))
    cloud = Cloud(points, stamps, STAMP_NS, "odom")
    received = cloud_from_message(_sent(cloud_to_message(cloud), StampedIntensityCloudArrays))
    assert received.points.tobytes() == points.tobytes()
    assert received.time_stamps.tobytes() == stamps.tobytes()
    assert (received.stamp_ns, received.frame_id, received.height) == (STAMP_NS, "odom", 1)


def test_a_subscriber_without_numpy_reads_the_same_stamps():
    received = _sent(cloud_to_message(cloud_of([1, 2, 3])), StampedIntensityCloud)
    assert list(received.timeStamps) == [1.0, 2.0, 3.0]
    assert cloud_from_message(received).time_stamps.tolist() == [1.0, 2.0, 3.0]


def test_an_organised_cloud_comes_back_organised():
    message = cloud_to_message(cloud_of([1, np.nan, 3, 4, 5, 6], height=2))
    assert (message.cloud.height, message.cloud.width, message.cloud.row_step) == (2, 3, 48)
    assert cloud_from_message(message).height == 2


@pytest.mark.parametrize("strengths", [[1, np.nan, 3], [1, 2, 3]])
def test_an_organised_cloud_of_one_beam_comes_back_organised(strengths):
    message = _sent(cloud_to_message(replace(cloud_of(strengths), organized=True)), StampedIntensityCloudArrays)
    cloud = cloud_from_message(message)
    assert (cloud.organized, cloud.height, cloud.broken) == (True, 1, 0)


def test_a_cloud_that_says_it_is_finite_and_is_not_is_broken():
    message = cloud_to_message(cloud_of([1, np.nan, 3]))
    message.cloud.is_dense = True
    assert cloud_from_message(message).broken == 1


def test_a_laser_scan_holds_at_one_moment_and_its_angles_grow():
    turn = PlanarLaserScan(np.array([1, np.inf, 3, 4], np.float32), np.arange(4, dtype=np.float32), 0.5, 50.0, 16.0)
    scan = _sent(laser_scan_message(turn, STAMP_NS, "sonar"), LaserScan)
    assert (scan.header.frame_id, scan.header.stamp.to_nsec()) == ("sonar", STAMP_NS)
    assert (scan.angle_min, scan.angle_increment) == (pytest.approx(-math.pi), pytest.approx(math.pi / 2))
    assert scan.angle_max == pytest.approx(scan.angle_min + 3 * scan.angle_increment)
    assert (scan.time_increment, scan.scan_time, scan.range_min, scan.range_max) == (0.0, 16.0, 0.5, 50.0)
    assert (scan.ranges, scan.intensities) == ((1.0, math.inf, 3.0, 4.0), (0.0, 1.0, 2.0, 3.0))


def test_a_cloud_is_dense_when_every_point_is_finite():
    assert point_cloud(cloud_of([1, 2]).points, 0, "odom").is_dense is True
    assert point_cloud(cloud_of([1, np.nan]).points, 0, "odom").is_dense is False


def test_both_headers_of_a_stamped_cloud_agree():
    message = cloud_to_message(cloud_of([1]))
    assert message.header == message.cloud.header == Header(stamp=genpy.Time(5), frame_id="odom")


def test_a_cloud_may_have_other_fields_than_intensity():
    message = point_cloud(np.arange(10.0).reshape(2, 5), 0, "map", fields=("x", "y", "z", "intensity", "count"))
    assert [(f.name, f.offset, f.datatype, f.count) for f in message.fields] == [
        (name, 4 * index, PointField.FLOAT32, 1) for index, name in enumerate(("x", "y", "z", "intensity", "count"))
    ]
    assert (message.point_step, message.width, len(message.data)) == (20, 2, 40)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_more_or_fewer_stamps_than_points_are_refused(count):
    message = cloud_to_message(cloud_of([1, 2]))
    message.timeStamps = np.zeros(count)
    with pytest.raises(RefusedInput, match=f"2 points but {count} time stamps"):
        cloud_from_message(message)


def test_pcls_padded_layout_is_read():
    kind = np.dtype(
        {"names": ["x", "y", "z", "intensity"], "formats": ["<f4"] * 4, "offsets": [0, 4, 8, 16], "itemsize": 32}
    )
    rows = [(1, 4, 7, 10), (2, 5, 8, 11), (3, 6, 9, 12)]
    assert points_from_message(_message(np.array(rows, kind))).tolist() == [list(row) for row in rows]


def test_fields_may_come_in_any_order_and_between_others():
    kind = [("intensity", "<f4"), ("ring", "<u2"), ("z", "<f4"), ("y", "<f4"), ("x", "<f4")]
    assert points_from_message(_message(np.array([(40, 1, 3, 2, 1)], kind))).tolist() == [[1, 2, 3, 40]]


@pytest.mark.parametrize("missing", ["x", "y", "z", "intensity"])
def test_a_cloud_without_one_of_the_fields_is_refused(missing):
    message = point_cloud(np.zeros((1, 4)), 0, "odom")
    message.fields = [field for field in message.fields if field.name != missing]
    with pytest.raises(RefusedInput, match=f"no float32 field {missing}"):
        points_from_message(message)


def test_a_field_of_another_type_is_refused():
    kind = [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4")]
    with pytest.raises(RefusedInput, match="no float32 field x, y, z"):
        points_from_message(_message(np.zeros(1, kind)))


def test_a_field_of_several_values_is_refused():
    message = _message(np.zeros(1, [(name, "<f4") for name in ("x", "y", "z", "intensity")]))
    message.fields[3].count = 2
    with pytest.raises(RefusedInput, match="no float32 field intensity"):
        points_from_message(message)


@pytest.mark.parametrize(
    ("length", "step", "is_bigendian"),
    [
        *((length, 16, False) for length in (0, 31, 33, 16)),
        (0, 0, False),
        (24, 12, False),
        (30, 15, False),
        (32, 16, True),
    ],
)
def test_data_that_are_not_as_announced_shorter_than_their_fields_or_big_endian_are_refused(length, step, is_bigendian):
    message = point_cloud(np.zeros((2, 4)), 0, "odom")
    message.point_step, message.data, message.is_bigendian = step, bytes(length), is_bigendian
    with pytest.raises(RefusedInput, match=f"{length} bytes for 2 points of {step} bytes"):
        points_from_message(message)


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[st.floats(-100.0, 100.0)] * 3))
def test_a_transform_is_its_matrix(rotation, shift):
    expected = pose_matrix(shift, rotation)
    matrix = matrix_from_message(Transform(Vector3(*shift), Quaternion(*quaternion_of(expected))))
    np.testing.assert_allclose(matrix[:3, :3], expected[:3, :3], atol=1e-12)
    assert matrix[:3, 3].tolist() == list(shift)
    assert matrix[3].tolist() == [0, 0, 0, 1]


@pytest.mark.parametrize("axis", range(3))
def test_half_a_turn_has_a_quaternion(axis):
    turned = -np.eye(3)
    turned[axis, axis] = 1.0
    np.testing.assert_allclose(np.abs(quaternion_of(turned)), np.eye(4)[axis])


@pytest.mark.parametrize(
    ("shift", "quaternion"),
    [((0, 0, 0), (0, 0, 0, 0)), ((0, 0, 0), (0, 0, 0, math.nan)), ((math.nan, 0, 0), (0, 0, 0, 1)),
     ((0, math.inf, 0), (0, 0, 0, 1)), ((0, 0, 0), (0, 0, 0, 5))],
)  # fmt: skip
def test_a_transform_that_is_none_is_refused(shift, quaternion):
    with pytest.raises(RefusedInput) as refused:
        matrix_from_message(Transform(Vector3(*shift), Quaternion(*quaternion)))
    assert refused.value.kind == "transforms refused"
