"""Messages to arrays and back, by the buffer and never point by point."""

import math
from functools import lru_cache
from typing import List, Sequence, Tuple

import numpy as np
from rospy.numpy_msg import numpy_msg
from sensor_msgs.msg import LaserScan, PointCloud2, PointField

from node_support.errors import RefusedInput
from node_support.headers import check_frame, check_point_stamps, check_stamp
from node_support.ros.transforms import header
from sonar_processing.cloud import Cloud
from sonar_processing.scans.polar_scan import PlanarLaserScan
from underwater_map_construction.msg import StampedIntensityCloud

StampedIntensityCloudArrays = numpy_msg(StampedIntensityCloud)
"""StampedIntensityCloud whose time stamps are a numpy array, as subscribers and publishers here use it."""

LaserScanArrays = numpy_msg(LaserScan)
"""LaserScan whose ranges and intensities are numpy arrays."""

POINT_FIELDS = ("x", "y", "z", "intensity")
_FLOAT_BYTES = 4  # Of a FLOAT32 in a PointCloud2


def cloud_from_message(message: StampedIntensityCloud) -> Cloud:
    """Return the cloud of a StampedIntensityCloud; raises RefusedInput for one that cannot be used.

    A cloud of one row that says it may hold points that are not finite is organised: a single beam.
    """
    stamp_ns, frame_id = message.header.stamp.to_nsec(), message.header.frame_id
    check_frame(frame_id, "clouds refused")
    check_stamp(stamp_ns)
    time_stamps = np.asarray(message.timeStamps, dtype=np.float64)
    check_point_stamps(time_stamps, stamp_ns)
    return Cloud(
        points=points_from_message(message.cloud),
        time_stamps=time_stamps,
        stamp_ns=stamp_ns,
        frame_id=frame_id,
        height=max(message.cloud.height, 1),
        organized=not message.cloud.is_dense,
    )


def points_from_message(
    message: PointCloud2, wanted: Sequence[str] = POINT_FIELDS, kind: str = "clouds refused"
) -> np.ndarray:
    """Return (n, len(wanted)) float32; raises RefusedInput of a `kind` for missing fields and too little data."""
    offsets = {f.name: f.offset for f in message.fields if f.datatype == PointField.FLOAT32 and f.count <= 1}
    missing = [name for name in wanted if name not in offsets]
    if missing:
        raise RefusedInput(kind, f"no float32 field {', '.join(missing)}; check the publisher")
    places = [offsets[name] for name in wanted]
    count, step = message.width * message.height, message.point_step
    if message.is_bigendian or step < max(places) + _FLOAT_BYTES or len(message.data) != count * step:
        raise RefusedInput(kind, f"{len(message.data)} bytes for {count} points of {step} bytes; check the publisher")
    if count == 0:
        return np.zeros((0, len(wanted)), dtype=np.float32)
    if places == list(range(0, step, _FLOAT_BYTES)):
        return np.frombuffer(message.data, dtype=np.float32).reshape(-1, len(wanted))
    row = np.dtype({"names": wanted, "formats": ["<f4"] * len(wanted), "offsets": places, "itemsize": step})
    rows = np.frombuffer(message.data, dtype=row)
    return np.column_stack([rows[name] for name in wanted])


def point_cloud(
    points: np.ndarray, stamp_ns: int, frame_id: str, height: int = 1, fields: Sequence[str] = POINT_FIELDS
) -> PointCloud2:
    """Return a PointCloud2 of (n, len(fields)) points, every field a float32."""
    width = len(points) // height
    step = _FLOAT_BYTES * len(fields)
    return PointCloud2(
        header=header(stamp_ns, frame_id),
        height=height,
        width=width,
        fields=_point_fields(tuple(fields)),
        is_bigendian=False,
        point_step=step,
        row_step=step * width,
        data=np.ascontiguousarray(points, dtype="<f4").tobytes(),
        is_dense=bool(np.isfinite(points).all()),
    )


def cloud_to_message(cloud: Cloud) -> StampedIntensityCloud:
    return StampedIntensityCloudArrays(
        header=header(cloud.stamp_ns, cloud.frame_id),
        cloud=points_to_message(cloud),
        timeStamps=np.ascontiguousarray(cloud.time_stamps, dtype="<f8"),
    )


def points_to_message(cloud: Cloud) -> PointCloud2:
    """Return the PointCloud2 of a cloud; an organised one says that it may hold points that are not finite."""
    message = point_cloud(cloud.points, cloud.stamp_ns, cloud.frame_id, cloud.height)
    message.is_dense = message.is_dense and not cloud.organized
    return message


def laser_scan_message(scan: PlanarLaserScan, stamp_ns: int, frame_id: str) -> LaserScan:
    """Return a planar laser scan as LaserScan: all rays hold at `stamp_ns`, so there is no time between them."""
    increment = scan.angle_increment
    return LaserScanArrays(
        header=header(stamp_ns, frame_id),
        angle_min=-math.pi,
        angle_max=-math.pi + (scan.ranges.size - 1) * increment,
        angle_increment=increment,
        time_increment=0.0,
        scan_time=scan.duration,
        range_min=scan.range_min,
        range_max=scan.range_max,
        ranges=scan.ranges,
        intensities=scan.intensities,
    )


@lru_cache(maxsize=None)
def _point_fields(names: Tuple[str, ...]) -> List[PointField]:
    return [
        PointField(name=name, offset=_FLOAT_BYTES * index, datatype=PointField.FLOAT32, count=1)
        for index, name in enumerate(names)
    ]
