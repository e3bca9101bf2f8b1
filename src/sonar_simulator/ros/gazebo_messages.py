"""Converts the messages of Gazebo's ray sensor plugins to rays: LaserScan, PointCloud and PointCloud2."""

from typing import Callable, Dict, Optional

import numpy as np
from genpy import DeserializationError, Message
from rospy import AnyMsg
from sensor_msgs.msg import LaserScan, PointCloud, PointCloud2, PointField

from node_support.errors import RefusedInput
from node_support.headers import check_frame, check_stamp
from sonar_simulator.gazebo.beams import RayScan
from sonar_simulator.gazebo.parameters import GazeboSonarParameters
from sonar_simulator.gazebo.rays import Rays, ScanLayout, rays_of_points, rays_of_scan

_NUMPY_TYPES = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}


def ray_scan(message: AnyMsg, parameters: GazeboSonarParameters) -> RayScan:
    """Return the scan in a message of one of the three types; raises RefusedInput for one that cannot be used."""
    kind = message._connection_header["type"]
    if kind not in _KINDS:
        raise RefusedInput("scans refused", f"type {kind}, must be one of {', '.join(_KINDS)}")
    try:
        typed = _KINDS[kind]().deserialize(message._buff)
    except DeserializationError as error:
        raise RefusedInput("scans refused", f"{kind}: {error}") from error
    stamp_ns, frame_id = typed.header.stamp.to_nsec(), typed.header.frame_id.lstrip("/")
    check_stamp(stamp_ns)
    check_frame(frame_id, "scans refused")
    return RayScan(_CONVERSIONS[kind](typed, parameters), stamp_ns, frame_id)


def _of_laser_scan(scan: LaserScan, parameters: GazeboSonarParameters) -> Rays:
    layout = ScanLayout(scan.angle_min, scan.angle_max, scan.angle_increment, scan.range_max)
    return rays_of_scan(layout, np.asarray(scan.ranges), np.asarray(scan.intensities), parameters.vertical_opening)


def _of_point_cloud(cloud: PointCloud, parameters: GazeboSonarParameters) -> Rays:
    points = np.array([(point.x, point.y, point.z) for point in cloud.points]).reshape(-1, 3)
    # gazebo_ros_block_laser leaves the name of its only channel empty.
    values = [channel.values for channel in cloud.channels if len(channel.values) == len(points)]
    intensities = np.asarray(values[0]) if values else None
    return rays_of_points(points, intensities, parameters.ray_rows, parameters.nothing_range)


def _of_point_cloud2(cloud: PointCloud2, parameters: GazeboSonarParameters) -> Rays:
    columns = {name: _field(cloud, name) for name in ("x", "y", "z", "intensity")}
    missing = [name for name in ("x", "y", "z") if columns[name] is None]
    if missing:
        raise RefusedInput("scans refused", f"no float field {', '.join(missing)}")
    points = np.column_stack([columns[name] for name in ("x", "y", "z")])
    rows = parameters.ray_rows or (cloud.height if cloud.height > 1 else 0)
    return rays_of_points(points, columns["intensity"], rows, parameters.nothing_range)


def _field(cloud: PointCloud2, name: str) -> Optional[np.ndarray]:
    found = [field for field in cloud.fields if field.name == name and field.datatype in _NUMPY_TYPES]
    if not found:
        return None
    count, step = cloud.width * cloud.height, cloud.point_step
    kind = np.dtype((">" if cloud.is_bigendian else "<") + _NUMPY_TYPES[found[0].datatype])
    if len(cloud.data) != count * step or found[0].offset + kind.itemsize > step:
        raise RefusedInput("scans refused", f"{len(cloud.data)} bytes for {count} points of {step} bytes")
    if count == 0:
        return np.zeros(0)
    row = np.dtype({"names": [name], "formats": [kind], "offsets": [found[0].offset], "itemsize": step})
    return np.frombuffer(cloud.data, dtype=row)[name].astype(np.float64)


_KINDS: Dict[str, type] = {kind._type: kind for kind in (LaserScan, PointCloud, PointCloud2)}
_CONVERSIONS: Dict[str, Callable[[Message, GazeboSonarParameters], Rays]] = {
    LaserScan._type: _of_laser_scan,
    PointCloud._type: _of_point_cloud,
    PointCloud2._type: _of_point_cloud2,
}
