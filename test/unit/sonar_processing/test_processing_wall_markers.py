"""Markers of walls fit a tank as well as a marina."""

import pytest
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker

from sonar_processing.ros.shape_messages import wall_markers
from underwater_map_construction.msg import Wall, Walls


def _walls(size, *offsets):
    """Return walls that are `size` m long, `offsets` m away along y."""
    ends = [(Point(0.0, offset, -1.0), Point(size, offset, -1.0)) for offset in offsets]
    return Walls(walls=[Wall(start=start, end=end, sonar_distance=abs(start.y)) for start, end in ends])


def _texts(walls):
    return [marker for marker in wall_markers(walls).markers if marker.type == Marker.TEXT_VIEW_FACING]


@pytest.mark.parametrize(("size", "height"), [(8.0, 0.5), (40.0, 2.5), (200.0, 2.5)])
def test_texts_are_as_large_as_the_scan_allows(size, height):
    (text,) = _texts(_walls(size, 3.0))
    assert text.scale.z == pytest.approx(height)


def test_a_distance_that_would_lie_on_another_is_left_out():
    assert [text.text for text in _texts(_walls(8.0, 4.0, 4.3, -4.0))] == ["4.0 m", "4.0 m"]


def test_every_wall_has_its_line():
    lines = [one for one in wall_markers(_walls(8.0, 4.0, 4.3)).markers if one.type == Marker.LINE_STRIP]
    assert len(lines) == 2
