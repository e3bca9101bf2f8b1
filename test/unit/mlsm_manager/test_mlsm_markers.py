"""The packed markers are those that genpy would write, object by object."""

from io import BytesIO

import genpy
import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from made_blocks import blocks_of, boxes_by_list
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.ros.markers import COLORS, BlockMarkers
from mlsm_manager.surface_map.export.pictures import ColorBy, block_colors
from mlsm_manager.surface_map.tiles import TILE_BITS

HEADER = Header(seq=3, stamp=genpy.Time(12, 34), frame_id="map")
MIXED = [(0.0, 0.0), (0.0, 0.1), (-1.0, -0.7), (0.0, 0.5), (-4.0, 3.0), (0.0, 2.9), (5.0, 5.01)]


def _bytes(message):
    buff = BytesIO()
    message.serialize(buff)
    return buff.getvalue()


def _read(message):
    return MarkerArray().deserialize(_bytes(message)).markers


def _object_by_object(boxes, number):
    return Marker(
        header=HEADER,
        ns=boxes.type.name.lower(),
        id=number,
        type=Marker.CUBE_LIST,
        action=Marker.ADD,
        pose=Pose(orientation=Quaternion(w=1.0)),
        scale=Vector3(*boxes.size),
        color=COLORS[boxes.type],
        points=[Point(*center) for center in boxes.centers],
    )


@pytest.mark.parametrize("intervals", [MIXED, MIXED[:1], MIXED * 200, []])
def test_the_bytes_are_those_of_markers_built_point_by_point(intervals):
    blocks = blocks_of(intervals)
    packed = BlockMarkers().whole(blocks, HEADER)
    numbers = [marker.id for marker in _read(packed)]
    assert len(set(numbers)) == len(numbers)
    expected = [_object_by_object(boxes, number) for boxes, number in zip(boxes_by_list(blocks), numbers)]
    assert _bytes(packed) == _bytes(MarkerArray(markers=expected))


def test_a_class_of_boxes_that_vanished_is_deleted_once():
    markers = BlockMarkers()
    (shown,) = _read(markers.whole(blocks_of([(0.0, 0.1)]), HEADER))
    actions = {(m.ns, m.id): m.action for m in _read(markers.whole(blocks_of([(0.0, 4.0)]), HEADER))}
    assert actions.pop((shown.ns, shown.id)) == Marker.DELETE
    assert list(actions.values()) == [Marker.ADD]
    assert [m.action for m in _read(markers.whole(blocks_of([(0.0, 4.0)]), HEADER))] == [Marker.ADD]


def test_an_emptied_map_deletes_all_that_was_shown():
    markers = BlockMarkers()
    shown = {(m.ns, m.id) for m in _read(markers.whole(blocks_of(MIXED), HEADER))}
    left = _read(markers.whole(blocks_of([]), HEADER))
    assert {(m.ns, m.id) for m in left} == shown
    assert {m.action for m in left} == {Marker.DELETE}


def test_blocks_are_coloured_one_by_one_when_asked():
    blocks = blocks_of(MIXED)
    read = _read(BlockMarkers(ColorBy.HEIGHT).whole(blocks, HEADER))
    expected = block_colors(blocks, ColorBy.HEIGHT)
    for marker, boxes in zip(read, boxes_by_list(blocks)):
        colors = [[color.r, color.g, color.b] for color in marker.colors]
        np.testing.assert_allclose(colors, expected[boxes.owners], atol=1e-6)
        assert {color.a for color in marker.colors} == {1.0}


def test_a_changed_tile_is_sent_alone_and_keeps_its_ids():
    markers, blocks = BlockMarkers(), blocks_of([(0.0, 0.1)] * 40)
    before = {(m.points[0].x, m.ns): m.id for m in _read(markers.whole(blocks, HEADER))}
    assert len(before) == 3
    second = blocks.take((blocks.cells[:, 0] >> TILE_BITS) == 1)
    (sent,) = _read(markers.changed(second, [(1, 0)], HEADER))
    assert before[sent.points[0].x, sent.ns] == sent.id


def test_a_tile_that_lost_its_blocks_is_deleted():
    markers, blocks = BlockMarkers(), blocks_of([(0.0, 0.1)] * 40)
    ids = {m.id for m in _read(markers.whole(blocks, HEADER))}
    (deleted,) = _read(markers.changed(blocks_of([]), [(1, 0)], HEADER))
    assert (deleted.action, deleted.id in ids) == (Marker.DELETE, True)
    assert _read(markers.changed(blocks_of([]), [(1, 0)], HEADER)) == []


def test_a_late_subscriber_gets_all_and_changes_nothing_for_the_others():
    markers, blocks = BlockMarkers(), blocks_of([(0.0, 0.1)] * 40)
    shown = {m.id for m in _read(markers.whole(blocks, HEADER))}
    assert {m.id for m in _read(markers.again(blocks, HEADER))} == shown
    assert {m.id for m in _read(markers.whole(blocks_of([]), HEADER))} == shown
