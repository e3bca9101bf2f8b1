"""The packed markers are those that genpy would write, object by object."""

from io import BytesIO

import genpy
import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from made_blocks import blocks_of
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.ros.markers import COLORS, BlockMarkers
from mlsm_manager.surface_map.block_shapes import box_lists
from mlsm_manager.surface_map.blocks import BlockType

HEADER = Header(seq=3, stamp=genpy.Time(12, 34), frame_id="map")
MIXED = [(0.0, 0.0), (0.0, 0.1), (-1.0, -0.7), (0.0, 0.5), (-4.0, 3.0), (0.0, 2.9), (5.0, 5.01)]


def _bytes(message):
    buff = BytesIO()
    message.serialize(buff)
    return buff.getvalue()


def _read(message):
    return MarkerArray().deserialize(_bytes(message)).markers


def _object_by_object(boxes):
    return Marker(
        header=HEADER,
        ns=boxes.type.name.lower(),
        id=boxes.power + 64,
        type=Marker.CUBE_LIST,
        action=Marker.ADD,
        pose=Pose(orientation=Quaternion(w=1.0)),
        scale=Vector3(*boxes.size),
        color=COLORS[boxes.type],
        points=[Point(*center) for center in boxes.centers],
    )


@pytest.mark.parametrize("intervals", [MIXED, MIXED[:1], MIXED * 200])
def test_the_bytes_are_those_of_markers_built_point_by_point(intervals):
    blocks = blocks_of(intervals)
    expected = MarkerArray(markers=[_object_by_object(boxes) for boxes in box_lists(blocks)])
    assert _bytes(BlockMarkers().array(blocks, HEADER)) == _bytes(expected)


def test_a_subscriber_reads_every_box():
    blocks = blocks_of(MIXED)
    points = [[p.x, p.y, p.z] for marker in _read(BlockMarkers().array(blocks, HEADER)) for p in marker.points]
    assert points == np.concatenate([boxes.centers for boxes in box_lists(blocks)]).tolist()


def test_an_empty_map_makes_no_markers():
    assert _read(BlockMarkers().array(blocks_of([]), HEADER)) == []


def test_horizontal_and_vertical_blocks_differ_in_namespace_and_colour():
    markers = {marker.ns: marker for marker in _read(BlockMarkers().array(blocks_of([(0, 0), (0, 0.5)]), HEADER))}
    assert sorted(markers) == ["horizontal", "vertical"]
    assert markers["horizontal"].color != markers["vertical"].color


def test_markers_can_be_seen():
    for marker in _read(BlockMarkers().array(blocks_of(MIXED), HEADER)):
        assert marker.color.a == 1.0
        assert marker.pose.orientation == Quaternion(0.0, 0.0, 0.0, 1.0)
        assert min(marker.scale.x, marker.scale.y, marker.scale.z) > 0.0
        assert marker.header == HEADER


def test_a_class_of_boxes_that_vanished_is_deleted_once():
    markers = BlockMarkers()
    (shown,) = _read(markers.array(blocks_of([(0.0, 0.1)]), HEADER))
    actions = {(m.ns, m.id): m.action for m in _read(markers.array(blocks_of([(0.0, 4.0)]), HEADER))}
    assert actions.pop((shown.ns, shown.id)) == Marker.DELETE
    assert list(actions.values()) == [Marker.ADD]
    assert [m.action for m in _read(markers.array(blocks_of([(0.0, 4.0)]), HEADER))] == [Marker.ADD]


def test_an_emptied_map_deletes_all_that_was_shown():
    markers = BlockMarkers()
    shown = {(m.ns, m.id) for m in _read(markers.array(blocks_of(MIXED), HEADER))}
    left = _read(markers.array(blocks_of([]), HEADER))
    assert {(m.ns, m.id) for m in left} == shown
    assert {m.action for m in left} == {Marker.DELETE}


def test_no_two_markers_of_a_message_share_namespace_and_id():
    names = [(m.ns, m.id) for m in _read(BlockMarkers().array(blocks_of(MIXED), HEADER))]
    assert len(set(names)) == len(names) > 3


def test_surfaces_that_points_make_have_a_colour():
    assert set(COLORS) == {BlockType.HORIZONTAL, BlockType.VERTICAL}
