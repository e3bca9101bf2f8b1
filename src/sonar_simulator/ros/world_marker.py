"""The world as a marker, for rviz."""

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from sonar_simulator.world.world import World
from sonar_simulator.world.world_mesh import world_triangles

# Transparent, because the map grows on the world and must be visible through it.
_OPACITY = 0.45


def world_marker(world: World, frame_id: str, origin: np.ndarray) -> Marker:
    """Return all triangles of a world; stamped 0, so that rviz places it at any time.

    origin: (3,) m, where the frame begins in the world.
    """
    triangles = world_triangles(world)
    marker = Marker(ns="world", type=Marker.TRIANGLE_LIST, action=Marker.ADD, frame_locked=True)
    marker.header.frame_id = frame_id
    marker.pose = Pose(position=Point(*(-origin).tolist()), orientation=Quaternion(w=1.0))
    marker.scale = Vector3(1.0, 1.0, 1.0)
    marker.color = ColorRGBA(1.0, 1.0, 1.0, _OPACITY)
    marker.points = [Point(*corner) for corner in triangles.points.tolist()]
    marker.colors = [ColorRGBA(red, green, blue, _OPACITY * a) for red, green, blue, a in triangles.colours.tolist()]
    return marker
