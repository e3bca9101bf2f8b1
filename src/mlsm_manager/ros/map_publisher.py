"""Shows the map: what changed to those who listen, all of it once to those who come, nothing while nobody does."""

import threading
import time
from importlib.util import find_spec
from typing import Any, Callable, Optional

import numpy as np
import rospy
from nav_msgs.msg import MapMetaData, OccupancyGrid
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.export.formats import octree
from mlsm_manager.surface_map.export.rasters import occupancy
from mlsm_manager.surface_map.map_file import ExportError
from node_support import topics
from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.ros.callbacks import guarded, on_change
from sonar_processing.ros.conversions import header, point_cloud

CLOUD_FIELDS = ("x", "y", "z", "intensity", "height", "depth", "count", "type")
_MOST_TIME = 0.1  # share of the time that may go into sending the whole map on one topic again and again


def map_cloud(blocks: Blocks, free: Optional[Blocks], stamp_ns: int, frame_id: str) -> PointCloud2:
    """Return mean, height, depth, number of points and BlockType of every block, and behind them those of `free`."""
    rows = _cloud_rows(blocks, blocks.type)
    if free is not None:
        rows = np.concatenate([rows, _cloud_rows(free, np.full(len(free), BlockType.FREE))])
    return point_cloud(rows, stamp_ns, frame_id, fields=CLOUD_FIELDS)


def _cloud_rows(blocks: Blocks, kinds: np.ndarray) -> np.ndarray:
    return np.column_stack([blocks.mean, blocks.height, blocks.depth, blocks.count, kinds])


def has_octomap_messages() -> bool:
    return find_spec("octomap_msgs") is not None and find_spec("pyoctomap") is not None


def octomap_message(tree: Any, octomap_header: Header) -> Any:
    """Return a pyoctomap.OcTree as octomap_msgs/Octomap in its binary form, free and occupied."""
    from octomap_msgs.msg import Octomap

    message = Octomap(header=octomap_header, binary=True, id="OcTree", resolution=tree.getResolution())
    # The file's header ends with the line "data"; the message holds what follows.
    message.data = np.frombuffer(tree.writeBinary().split(b"\ndata\n", 1)[1], dtype=np.int8).tolist()
    return message


class _WholeMap(rospy.SubscribeListener):
    """A topic that carries the whole map in each message: built only for those who listen, and not all the time.

    is_due: whether the map changed since it was sent.
    """

    def __init__(self, topic: str, kind: Any, build: Callable[[], Any], localiser: Localiser, health: Health) -> None:
        self._build = build
        self._localiser = localiser
        self._next = 0.0
        self.is_due = False
        self._guarded = guarded(health, self._send)
        self._publisher = rospy.Publisher(topic, kind, subscriber_listener=self, queue_size=2)

    def peer_subscribe(self, _topic: str, _publish: Callable[[Any], None], peer_publish: Callable[[Any], None]) -> None:
        """Send all to who comes, once there is something."""
        if self._localiser.block_count:
            self._guarded(peer_publish)

    def publish_if_due(self) -> None:
        """Send the map if it changed, somebody listens, and the last time is long enough ago."""
        start = time.monotonic()
        if not self.is_due or start < self._next or not self._publisher.get_num_connections():
            return
        self.is_due = False
        self._guarded(self._publisher.publish)
        self._next = time.monotonic() + (time.monotonic() - start) / _MOST_TIME

    def _send(self, send: Callable[[Any], None]) -> None:
        try:
            message = self._build()
        except ExportError as error:
            raise RefusedInput("maps not sent", f"{self._publisher.name}: {error}") from None
        send(message)


class _Tiles(rospy.SubscribeListener):
    """MLSM/Markers: the tiles that changed, and the whole map to who comes.

    is_replaced: whether the next message deletes what is shown of another map.
    """

    def __init__(self, parameters: MlsmCoreParameters, localiser: Localiser, health: Health) -> None:
        self._localiser = localiser
        self._frame = parameters.map_frame
        self._markers = BlockMarkers(parameters.color_by)
        self._lock = threading.Lock()
        self.is_replaced = True
        self._send_all = guarded(health, self._again)
        self._publisher = rospy.Publisher(topics.MAP_MARKERS, MarkerArray, subscriber_listener=self, queue_size=10)

    def peer_subscribe(self, _topic: str, _publish: Callable[[Any], None], peer_publish: Callable[[Any], None]) -> None:
        self._send_all(peer_publish)

    def publish_if_changed(self) -> None:
        if not self._publisher.get_num_connections():
            return
        with self._lock:
            tiles, blocks = self._localiser.changed_tiles()
            if self.is_replaced or self._markers.is_outgrown(blocks):
                self.is_replaced = False
                self._publisher.publish(self._markers.whole(self._localiser.blocks, header(0, self._frame)))
            elif len(tiles):
                changed = self._markers.changed(blocks, map(tuple, tiles.tolist()), header(0, self._frame))
                self._publisher.publish(changed)

    def _again(self, send: Callable[[Any], None]) -> None:
        with self._lock:
            if self._localiser.block_count:
                send(self._markers.again(self._localiser.blocks, header(0, self._frame)))


class MapPublisher:
    """Publishes /MLSM/Markers, /MLSM/cloud, /MLSM/grid, the same as /map, and, where it is installed, /MLSM/octomap."""

    def __init__(self, parameters: MlsmCoreParameters, localiser: Localiser, health: Health) -> None:
        self._parameters = parameters
        self._localiser = localiser
        self._stamp_ns = 0
        self._tiles = _Tiles(parameters, localiser, health)
        self._whole = [
            _WholeMap(topics.MAP_CLOUD, PointCloud2, self._cloud, localiser, health),
            _WholeMap(topics.MAP_GRID, OccupancyGrid, self.grid, localiser, health),
            _WholeMap(topics.MAP_OF_NAVIGATION, OccupancyGrid, self.grid, localiser, health),
            _WholeMap(topics.MAP_METADATA, MapMetaData, lambda: self.grid().info, localiser, health),
        ]
        if has_octomap_messages():
            from octomap_msgs.msg import Octomap

            self._whole.append(_WholeMap(topics.MAP_OCTOMAP, Octomap, self._octomap, localiser, health))
        self._tell = on_change(parameters.map_period, self._publish, health)
        # rospy takes connections before it knows the listeners, and tells them of none that came so early.
        if localiser.block_count:
            self.replace()

    def change(self, stamp_ns: Optional[int] = None) -> None:
        """Publish soon, because the map changed, by a cloud with this stamp where there is one."""
        if stamp_ns is not None:
            self._stamp_ns = stamp_ns
        for topic in self._whole:
            topic.is_due = True
        self._tell()

    def replace(self) -> None:
        """Publish soon, because there is another map now."""
        self._tiles.is_replaced = True
        self.change()

    def _publish(self) -> None:
        self._tiles.publish_if_changed()
        for topic in self._whole:
            topic.publish_if_due()

    def _cloud(self) -> PointCloud2:
        # In each message the stamp is read before the map: a cloud that comes between them may be there early, but
        # none that the stamp tells of is missing.
        stamp_ns = self._stamp_ns
        free = self._localiser.free if self._parameters.cloud_free else None
        return map_cloud(self._localiser.blocks, free, stamp_ns, self._parameters.map_frame)

    def grid(self) -> OccupancyGrid:
        """Return the map from above: -1 unknown, 0 free, 100 occupied."""
        parameters = self._parameters
        message = OccupancyGrid(header=header(self._stamp_ns, parameters.map_frame))
        grid = occupancy(self._localiser.blocks, self._localiser.free, parameters.grid_low, parameters.grid_high)
        message.info.map_load_time = message.header.stamp
        message.info.resolution = grid.resolution
        message.info.height, message.info.width = grid.values.shape
        message.info.origin.position.x, message.info.origin.position.y = grid.origin
        message.info.origin.orientation.w = 1.0
        message.data = grid.values.ravel().tolist()
        return message

    def _octomap(self) -> Any:
        stamp_ns = self._stamp_ns
        tree = octree(self._localiser.blocks, self._localiser.free)
        return octomap_message(tree, header(stamp_ns, self._parameters.map_frame))
