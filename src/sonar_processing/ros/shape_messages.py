"""Walls and circles as messages and as markers for rviz."""

import math
from typing import Sequence

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import header
from sonar_processing.shapes.circles import Circle
from sonar_processing.shapes.lines import Line
from underwater_map_construction import msg

_TEXT_COLOR = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)  # which can be read on the line of the wall too
WALL_COLOR = ColorRGBA(r=1.0, g=0.25, b=0.75, a=1.0)
CIRCLE_COLOR = ColorRGBA(r=0.2, g=1.0, b=0.45, a=0.8)
# Heights of texts in a scan's longest distance, legible where the scan fills the window; m, where it is a marina's.
_TEXTS_IN_SCAN, _GREATEST_TEXT = 16.0, 2.5
_LINE_WIDTH = 0.1  # of the height of a text: seen in rviz beside the cells of a map
_TEXT_WIDTH = 3.5  # of its height: "12.3 m"
_LEAST_HEIGHT = 0.5  # m: a circle is drawn as a flat disc, since its height is unknown


def walls_message(cloud: Cloud, lines: Sequence[Line], sonar: np.ndarray) -> msg.Walls:
    """Return the walls of a scan; `sonar` (2,) x y [m] in the cloud's frame, NaN when unknown."""
    walls = [_wall(cloud, line, sonar) for line in lines]
    return msg.Walls(header=header(cloud.stamp_ns, cloud.frame_id), walls=walls)


def circles_message(cloud: Cloud, circles: Sequence[Circle]) -> msg.Circles:
    found = [_circle(cloud, circle) for circle in circles]
    return msg.Circles(header=header(cloud.stamp_ns, cloud.frame_id), circles=found)


def wall_markers(message: msg.Walls) -> MarkerArray:
    """Return a line on each wall, from end to end, and its distance from the sonar; older markers go.

    A distance whose text would lie on an earlier one is left out.
    """
    markers = [Marker(header=message.header, action=Marker.DELETEALL)]
    height, labelled = _text_height(message.walls), []
    for number, wall in enumerate(message.walls):
        line = _marker(message.header, "walls", number, Marker.LINE_STRIP, WALL_COLOR)
        line.points = [wall.start, wall.end]
        line.scale = Vector3(_LINE_WIDTH * height, 0.0, 0.0)
        markers.append(line)
        middle = (_array(wall.start) + _array(wall.end)) / 2.0
        is_free = all(np.linalg.norm(middle - other) > _TEXT_WIDTH * height for other in labelled)
        if math.isfinite(wall.sonar_distance) and is_free:
            labelled.append(middle)
            markers.append(_distance(message.header, number, middle, height, wall.sonar_distance))
    return MarkerArray(markers=markers)


def circle_markers(message: msg.Circles) -> MarkerArray:
    markers = [Marker(header=message.header, action=Marker.DELETEALL)]
    for number, circle in enumerate(message.circles):
        cylinder = _marker(message.header, "circles", number, Marker.CYLINDER, CIRCLE_COLOR)
        cylinder.pose.position = circle.center
        cylinder.scale = Vector3(2.0 * circle.radius, 2.0 * circle.radius, _LEAST_HEIGHT)
        markers.append(cylinder)
    return MarkerArray(markers=markers)


def _wall(cloud: Cloud, line: Line, sonar: np.ndarray) -> msg.Wall:
    z = _middle_height(cloud, line.members)
    return msg.Wall(
        orientation=line.orientation,
        distance=line.offset,
        sonar_distance=line.distance_from(sonar),
        start=Point(*line.ends[0], z),
        end=Point(*line.ends[1], z),
        inliers=len(line.members),
        echoes=line.echoes,
        residual=line.residual,
    )


def _circle(cloud: Cloud, circle: Circle) -> msg.Circle:
    return msg.Circle(
        center=Point(*circle.center, _middle_height(cloud, circle.members)),
        radius=circle.radius,
        inliers=len(circle.members),
        echoes=circle.echoes,
        residual=circle.residual,
    )


def _middle_height(cloud: Cloud, members: np.ndarray) -> float:
    return float(np.mean(cloud.points[members, 2], dtype=np.float64))


def _array(point: Point) -> np.ndarray:
    return np.array([point.x, point.y, point.z])


def _marker(head: Header, namespace: str, number: int, kind: int, color: ColorRGBA) -> Marker:
    marker = Marker(header=head, ns=namespace, id=number, type=kind, action=Marker.ADD, color=color)
    marker.pose.orientation = Quaternion(w=1.0)
    return marker


def _distance(head: Header, number: int, place: np.ndarray, height: float, distance: float) -> Marker:
    marker = _marker(head, "wall distances", number, Marker.TEXT_VIEW_FACING, _TEXT_COLOR)
    marker.pose.position = Point(place[0], place[1], place[2] + height)
    marker.scale = Vector3(0.0, 0.0, height)
    marker.text = f"{distance:.1f} m"
    return marker


def _text_height(walls: Sequence[msg.Wall]) -> float:
    """Return the height of texts, m: the same share of a tank and of a marina."""
    lengths = [float(np.linalg.norm(_array(wall.end) - _array(wall.start))) for wall in walls]
    distances = [wall.sonar_distance for wall in walls if math.isfinite(wall.sonar_distance)]
    return min(max([*lengths, *distances], default=0.0) / _TEXTS_IN_SCAN, _GREATEST_TEXT)
