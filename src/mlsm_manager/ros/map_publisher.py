"""Shows the map: block markers and block means, latched, so that a late subscriber sees all of it."""

import threading
from typing import Callable, Optional

import numpy as np
import rospy
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.blocks import Blocks
from node_support import topics
from sonar_processing.ros.conversions import header, point_cloud

CLOUD_FIELDS = ("x", "y", "z", "intensity", "height", "depth", "count")


class MapPublisher:
    """Publishes /MLSM/Markers and /MLSM/cloud."""

    def __init__(self, map_frame: str) -> None:
        self._map_frame = map_frame
        self._block_markers = BlockMarkers()
        self._markers = rospy.Publisher(topics.MAP_MARKERS, MarkerArray, queue_size=2, latch=True)
        self._cloud = rospy.Publisher(topics.MAP_CLOUD, PointCloud2, queue_size=2, latch=True)
        self._changed = threading.Event()
        self._stamp_ns = 0

    def change(self, stamp_ns: Optional[int] = None) -> None:
        """Remember that the map changed, by a cloud with this stamp where there is one."""
        if stamp_ns is not None:
            self._stamp_ns = stamp_ns
        self._changed.set()

    def publish_if_changed(self, blocks: Callable[[], Blocks]) -> None:
        """Send the whole map, which `blocks` returns, if it changed since it was sent last."""
        if self._changed.is_set():
            self._changed.clear()
            self.publish(blocks(), self._stamp_ns)

    def publish(self, blocks: Blocks, stamp_ns: int) -> None:
        """Send the whole map."""
        self._markers.publish(self._block_markers.whole(blocks, header(0, self._map_frame)))
        rows = np.column_stack([blocks.mean, blocks.height, blocks.depth, blocks.count])
        self._cloud.publish(point_cloud(rows, stamp_ns, self._map_frame, fields=CLOUD_FIELDS))
