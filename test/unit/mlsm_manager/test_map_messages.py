"""The map as messages: boxes that show blocks where they are, packed as genpy would write them, and OctoMap's tree."""

import sys
from collections import Counter, defaultdict
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import NamedTuple, Tuple

import genpy
import genpy.dynamic
import numpy as np
import pytest
from foreign_messages import serialised
from geometry_msgs.msg import Point, Vector3
from hypothesis import example, given
from hypothesis import strategies as st
from made_maps import blocks_of, random_map
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.ros.map_publisher import CLOUD_FIELDS, has_octomap_messages, map_cloud, octomap_message
from mlsm_manager.ros.markers import COLORS, BlockMarkers
from mlsm_manager.ros.status_teller import ellipse, status_markers
from mlsm_manager.surface_map.blocks import BlockType
from mlsm_manager.surface_map.boxes import THINNEST, TILE_BITS, box_lists, box_size, box_type
from mlsm_manager.surface_map.export.formats import octree, write_octree
from mlsm_manager.surface_map.export.pictures import ColorBy, block_colors
from node_support.geometry import matrices
from underwater_map_construction.msg import PositionStatus

HEADER = Header(seq=3, stamp=genpy.Time(12, 34), frame_id="map")
MIXED = [(0.0, 0.0), (0.0, 0.1), (-1.0, -0.7), (0.0, 0.5), (-4.0, 3.0), (0.0, 2.9), (5.0, 5.01)]


class BoxList(NamedTuple):
    """Boxes of one type and size (3,) m in one tile: centers (n, 3) m, owners (n,) of the blocks that they show."""

    type: BlockType
    size: np.ndarray
    tile: Tuple[int, int]
    centers: np.ndarray
    owners: np.ndarray


def boxes_by_list(blocks):
    """Return the lists of boxes that show `blocks`."""
    lists = box_lists(blocks)
    parts = [slice(start, end) for start, end in zip(lists.starts, lists.starts[1:])]
    return [
        BoxList(
            box_type(power), np.array(box_size(blocks.resolution, power)), tuple(tile), lists.centers[part],
            lists.owners[part],
        )
        for tile, power, part in zip(lists.tiles.tolist(), lists.powers.tolist(), parts)
    ]  # fmt: skip


def _read(message):
    return MarkerArray().deserialize(serialised(message)).markers


def _object_by_object(boxes, number):
    marker = Marker(header=HEADER, ns=boxes.type.name.lower(), id=number, type=Marker.CUBE_LIST)
    marker.pose.orientation.w, marker.scale, marker.color = 1.0, Vector3(*boxes.size), COLORS[boxes.type]
    marker.points = [Point(*center) for center in boxes.centers]
    return marker


@pytest.mark.parametrize("intervals", [MIXED, MIXED[:1], MIXED * 200, []])
def test_the_bytes_are_those_of_markers_built_point_by_point(intervals):
    blocks = blocks_of(intervals)
    packed = BlockMarkers().whole(blocks, HEADER)
    numbers = [marker.id for marker in _read(packed)]
    assert len(set(numbers)) == len(numbers)
    expected = [_object_by_object(boxes, number) for boxes, number in zip(boxes_by_list(blocks), numbers)]
    assert serialised(packed) == serialised(MarkerArray(markers=expected))


def test_a_class_of_boxes_that_vanished_is_deleted_once():
    markers = BlockMarkers()
    (shown,) = _read(markers.whole(blocks_of([(0.0, 0.1)]), HEADER))
    actions = {(m.ns, m.id): m.action for m in _read(markers.whole(blocks_of([(0.0, 4.0)]), HEADER))}
    assert actions.pop((shown.ns, shown.id)) == Marker.DELETE
    assert list(actions.values()) == [Marker.ADD]
    assert [m.action for m in _read(markers.whole(blocks_of([(0.0, 4.0)]), HEADER))] == [Marker.ADD]


@pytest.mark.parametrize("with_free", [False, True])
def test_a_cloud_tells_the_type_of_each_block_and_holds_free_ones_when_asked(with_free):
    blocks, free = blocks_of([(-4.0, 3.0), (0.0, 0.1)]), blocks_of([(-2.0, -2.0)])
    message = map_cloud(blocks, free if with_free else None, 10**9, "map")
    rows = np.frombuffer(message.data, "<f4").reshape(-1, len(CLOUD_FIELDS))
    assert [field.name for field in message.fields] == list(CLOUD_FIELDS)
    assert rows[:, CLOUD_FIELDS.index("type")].tolist() == [1, 0, 2][: 2 + with_free]
    np.testing.assert_allclose(rows[:2, :3], blocks.mean[:, :3], rtol=1e-6)


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


BOTTOMS = st.floats(-50.0, 50.0)
DEPTHS = st.one_of(st.floats(0.0, 40.0), st.integers(0, 64).map(lambda eighths: eighths * 0.125))


@given(st.lists(st.tuples(BOTTOMS, DEPTHS), min_size=1, max_size=20), st.sampled_from([0.1, 0.5, 1.0]))
def test_boxes_reach_from_bottom_to_top_without_a_gap(intervals, resolution):
    blocks = blocks_of([(bottom, bottom + depth) for bottom, depth in intervals], resolution)
    drawn = defaultdict(list)
    for boxes in boxes_by_list(blocks):
        for block, z in zip(boxes.owners, boxes.centers[:, 2]):
            drawn[block].append((z - boxes.size[2] / 2.0, z + boxes.size[2] / 2.0))
    for block, (bottom, top) in enumerate(zip(blocks.bottom, blocks.height)):
        spans = sorted(drawn[block])
        thickness = max(top - bottom, resolution * 2.0**THINNEST)
        middle = (bottom + top) / 2.0
        assert spans[0][0] == pytest.approx(middle - thickness / 2.0, abs=1e-9)
        assert spans[-1][1] == pytest.approx(middle + thickness / 2.0, abs=1e-9)
        assert all(upper[0] <= lower[1] + 1e-9 for lower, upper in zip(spans, spans[1:]))


@given(st.lists(st.tuples(BOTTOMS, DEPTHS), min_size=1, max_size=20))
@example([(0.0, 3.0)] * 50)
def test_a_list_holds_boxes_of_one_tile_and_kind_that_know_their_blocks(intervals):
    blocks = blocks_of([(bottom, bottom + depth) for bottom, depth in intervals], 0.5)
    for boxes in boxes_by_list(blocks):
        np.testing.assert_array_equal(boxes.centers[:, :2], blocks.centers[boxes.owners])
        assert set(blocks.type[boxes.owners]) == {boxes.type}
        assert {tuple(tile) for tile in (blocks.cells[boxes.owners] >> TILE_BITS).tolist()} == {boxes.tile}


@pytest.mark.parametrize(("interval", "heights"), [((1.0, 3.0), [2.0]), ((0.0, 3.0), [1.0, 2.0])])
def test_a_depth_that_is_a_power_of_two_takes_one_box_and_any_other_two_that_overlap(interval, heights):
    (boxes,) = boxes_by_list(blocks_of([interval]))
    assert sorted(boxes.centers[:, 2].tolist()) == heights
    assert boxes.size.tolist() == [0.5, 0.5, 2.0]


def test_a_tile_of_metres_needs_few_lists_and_none_twice():
    lists = box_lists(blocks_of([(0.0, depth) for depth in np.linspace(0.0, 60.0, 2000)]))
    told = Counter(zip(map(tuple, lists.tiles.tolist()), lists.powers))
    assert set(told.values()) == {1}
    assert max(Counter(tile for tile, _ in told).values()) <= 11


DEFINITION = f"""Header header
bool binary
string id
float64 resolution
int8[] data
{"=" * 80}
MSG: std_msgs/Header
{Header._full_text}
"""
MD5 = "9a45536b45c5e409cd49f04bb2d9999f"
"""Of octomap_msgs/Octomap, as its package has it."""


@pytest.fixture
def message_type(monkeypatch):
    """Return the type octomap_msgs.msg.Octomap, which can be imported meanwhile."""
    pytest.importorskip("pyoctomap")
    kind = genpy.dynamic.generate_dynamic("octomap_msgs/Octomap", DEFINITION)["octomap_msgs/Octomap"]
    for name in ("octomap_msgs", "octomap_msgs.msg"):
        module = ModuleType(name)
        module.__spec__ = ModuleSpec(name, None)
        monkeypatch.setitem(sys.modules, name, module)
    sys.modules["octomap_msgs.msg"].Octomap = kind
    return kind


def test_the_type_is_that_of_octomap_msgs(message_type):
    assert message_type._md5sum == MD5
    assert has_octomap_messages()


def test_the_message_holds_the_tree_of_a_file(tmp_path, message_type):
    """octomap_msgs leaves out the header."""
    both = random_map(0).blocks, random_map(1).blocks
    received = message_type().deserialize(serialised(octomap_message(octree(*both), Header(frame_id="map"))))
    write_octree(tmp_path / "map.bt", *both)
    header, tree = (tmp_path / "map.bt").read_bytes().split(b"\ndata\n", 1)
    assert np.array(received.data, dtype=np.int8).tobytes() == tree
    assert f"id {received.id}\n".encode() in header
    assert (received.binary, received.header.frame_id, received.resolution) == (True, "map", 0.5)


def test_the_ellipse_of_a_position_holds_it_with_95_percent():
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    line = ellipse(covariance)
    squares = np.einsum("ni,ij,nj->n", line, np.linalg.inv(covariance), line)
    np.testing.assert_allclose(np.exp(-squares / 2.0), 0.05)


TEXT = "position doubtful, 0.4 m: sonar silent for 12 s (nothing on /sonar/raw); " * 3


@pytest.fixture
def drawn():
    status = PositionStatus(state=PositionStatus.DOUBTFUL, text=TEXT, age=14.2, covariance=np.eye(3).ravel())
    T_map_base = matrices(np.array([3.0, -48.0, 0.0]))
    T_map_base[2, 3] = -2.0
    return status_markers(status, T_map_base, 2.5, "map")


def test_the_status_at_the_vehicle_tells_the_age_of_the_fix_and_replaces_the_one_before(drawn):
    assert drawn[0].action == Marker.DELETEALL
    (*lines, last), *_ = [marker.text.split("\n") for marker in drawn if "\n" in marker.text]
    assert (" ".join(lines), last) == (TEXT.strip(), "fix 14 s ago")
    assert max(map(len, lines)) <= 52
    assert len({(marker.ns, marker.id) for marker in drawn}) == len(drawn)


def test_each_label_of_the_grid_tells_the_x_or_the_y_of_its_line(drawn):
    labels = [marker for marker in drawn if marker.text.lstrip("-").isdigit()]
    told = np.array([float(marker.text) for marker in labels])
    places = np.array([(marker.pose.position.x, marker.pose.position.y) for marker in labels])
    of_x = places[:, 1] == -80.0
    np.testing.assert_allclose(told[of_x], np.arange(-30.0, 51.0, 10.0))
    np.testing.assert_allclose(places[of_x, 0], told[of_x])
    np.testing.assert_allclose(told[~of_x], np.arange(-70.0, -19.0, 10.0))
    np.testing.assert_allclose(places[~of_x], [(-40.0, value) for value in told[~of_x]])
    (lines,) = (marker for marker in drawn if marker.type == Marker.LINE_LIST)
    assert {point.z for point in lines.points} == {-2.0}
