"""Messages laid out as Gazebo's ray sensor plugins lay them out, of a sensor in front of a wall across its x axis."""

import math

import numpy as np
import rospy
from geometry_msgs.msg import Point32
from sensor_msgs.msg import ChannelFloat32, LaserScan, PointCloud, PointCloud2, PointField
from std_msgs.msg import Header

RANGE_MIN = 0.1
RANGE_MAX = 50.1
ROWS = 9
VERTICAL = np.radians(np.linspace(-11.0, 11.0, ROWS))


def _ranges(bearings: np.ndarray, wall: float) -> np.ndarray:
    """Return distances (rows, columns), m; beyond the greatest range where the wall is not."""
    with np.errstate(divide="ignore"):
        distances = wall / (np.cos(VERTICAL)[:, np.newaxis] * np.cos(bearings))
    return np.where((distances > 0.0) & (distances < RANGE_MAX), distances, np.inf)


def laser_scan(header: Header, opening: float, columns: int, wall: float) -> LaserScan:
    """As gazebo_ros_laser: all rows one after the other, inf where nothing is hit, no word of the rows."""
    bearings = np.linspace(-opening / 2, opening / 2, columns)
    ranges = _ranges(bearings, wall).ravel()
    return LaserScan(
        header=header,
        angle_min=-opening / 2,
        angle_max=opening / 2,
        angle_increment=opening / (columns - 1),
        range_min=RANGE_MIN,
        range_max=RANGE_MAX,
        ranges=ranges.tolist(),
        intensities=[0.0] * len(ranges),
    )


def _points(opening: float, columns: int, wall: float) -> np.ndarray:
    """As gazebo_ros_block_laser: points at the greatest range less the smallest where nothing is hit, z upside down."""
    bearings = np.linspace(-opening / 2, opening / 2, columns)
    ranges = np.minimum(_ranges(bearings, wall), RANGE_MAX - RANGE_MIN)
    level = ranges * np.cos(VERTICAL)[:, np.newaxis]
    down = -ranges * np.sin(VERTICAL)[:, np.newaxis]
    return np.stack([level * np.cos(bearings), level * np.sin(bearings), down], axis=-1).reshape(-1, 3)


def block_laser(header: Header, opening: float, columns: int, wall: float) -> PointCloud:
    """As gazebo_ros_block_laser: one channel without a name."""
    points = _points(opening, columns, wall)
    channel = ChannelFloat32(values=[0.0] * len(points))
    return PointCloud(header=header, points=[Point32(*point) for point in points.tolist()], channels=[channel])


def cloud2(header: Header, opening: float, columns: int, wall: float) -> PointCloud2:
    """As plugins that publish PointCloud2: x, y, z, intensity and the ring, unordered, 22 bytes a point."""
    points = _points(opening, columns, wall).astype(np.float32)
    row = np.dtype({"names": ["xyz", "intensity", "ring"], "formats": ["3<f4", "<f4", "<u2"], "offsets": [0, 16, 20],
                    "itemsize": 22})  # fmt: skip
    rows = np.zeros(len(points), dtype=row)
    rows["xyz"] = points
    fields = [PointField(name, offset, PointField.FLOAT32, 1) for name, offset in (("x", 0), ("y", 4), ("z", 8))]
    fields += [PointField("intensity", 16, PointField.FLOAT32, 1), PointField("ring", 20, PointField.UINT16, 1)]
    return PointCloud2(
        header=header,
        height=1,
        width=len(rows),
        fields=fields,
        point_step=22,
        row_step=22 * len(rows),
        data=rows.tobytes(),
        is_dense=True,
    )


def header(seconds: float, frame_id: str) -> Header:
    """Return a header of some seconds after the Epoch."""
    return Header(stamp=rospy.Time.from_sec(seconds), frame_id=frame_id)


FULL_CIRCLE = 2.0 * math.pi
