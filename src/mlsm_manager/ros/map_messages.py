"""The map as messages."""

from importlib.util import find_spec
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.rasters import Raster
from sonar_processing.ros.conversions import header, point_cloud

CLOUD_FIELDS = ("x", "y", "z", "intensity", "height", "depth", "count")


def map_cloud(blocks: Blocks, stamp_ns: int, frame_id: str) -> PointCloud2:
    """Return mean, height, depth and number of points of every block."""
    rows = np.column_stack([blocks.mean, blocks.height, blocks.depth, blocks.count])
    return point_cloud(rows, stamp_ns, frame_id, fields=CLOUD_FIELDS)


def occupancy_grid(grid: Raster, stamp_ns: int, frame_id: str) -> OccupancyGrid:
    """Return a raster of `occupancy` as a message: -1 unknown, 0 free, 100 occupied."""
    message = OccupancyGrid(header=header(stamp_ns, frame_id))
    message.info.map_load_time = message.header.stamp
    message.info.resolution = grid.resolution
    message.info.height, message.info.width = grid.values.shape
    message.info.origin.position.x, message.info.origin.position.y = grid.origin
    message.info.origin.orientation.w = 1.0
    message.data = grid.values.ravel().tolist()
    return message


def has_octomap_messages() -> bool:
    """Return whether octomap_msgs and OctoMap's own library are installed."""
    return find_spec("octomap_msgs") is not None and find_spec("pyoctomap") is not None


def octomap_type() -> Any:
    """Return octomap_msgs.msg.Octomap."""
    from octomap_msgs.msg import Octomap

    return Octomap


def octomap_message(tree: Any, octomap_header: Header) -> Any:
    """Return a pyoctomap.OcTree as octomap_msgs/Octomap in its binary form, free and occupied."""
    message = octomap_type()(header=octomap_header, binary=True, id="OcTree", resolution=tree.getResolution())
    # The file's header ends with the line "data"; the message holds what follows.
    message.data = np.frombuffer(tree.writeBinary().split(b"\ndata\n", 1)[1], dtype=np.int8).tolist()
    return message
