"""A mission as an MCAP file of standard messages of ROS 2, for Foxglove and other programs that know no package."""

from pathlib import Path as File
from typing import Any, List

import numpy as np

from mlsm_manager.report.mission import Mission, Path
from mlsm_manager.self_check.verdict import Answer
from mlsm_manager.surface_map.export.rasters import occupancy
from node_support.files import whole_file
from recordings.bags.mcap_writer import McapWriter

_MAP, _VEHICLE = "map", "base_link"
_FLOAT32 = 7  # of PointField
_LEVELS = {Answer.FINE: 0, Answer.DOUBTFUL: 1, Answer.NOT_MEASURED: 3}  # of DiagnosticStatus: OK, WARN, STALE


def write_mcap(file: File, mission: Mission, picture: File) -> None:
    """Write map, grid, paths and checks at the start, then poses with covariance, transforms and scans in their order.

    picture: of the map, a PNG. Raises OSError, and RecordingError without the library mcap.
    """
    with whole_file(file) as temporary, McapWriter(temporary) as bag:
        start = round(mission.start * 1e9)
        blocks = mission.blocks
        bag.write("/map/blocks", _cloud(bag, start, blocks.mean), start)
        if len(blocks):
            bag.write("/map/grid", _grid(bag, start, mission), start)
        bag.write("/map/picture", _picture(bag, start, picture), start)
        for path in (*mission.paths, *mission.further):
            bag.write(f"/path/{path.name.replace(' ', '_').replace(',', '')}", _path(bag, start, path), start)
        bag.write("/checks", _checks(bag, start, mission), start)
        stamped = [*_poses(bag, mission), *_scans(bag, mission)]
        for stamp_ns, topic, message in sorted(stamped, key=lambda one: one[0]):
            bag.write(topic, message, stamp_ns)


def _stamped(bag: McapWriter, kind: str, stamp_ns: int, frame: str = _MAP) -> Any:
    message = bag.make(kind)
    message.header.stamp, message.header.frame_id = bag.time(stamp_ns), frame
    return message


def _cloud(bag: McapWriter, stamp_ns: int, points: np.ndarray) -> Any:
    """Return a PointCloud2 of points (n, 4): x y z [m] and echo strength."""
    message = _stamped(bag, "sensor_msgs/PointCloud2", stamp_ns)
    for index, name in enumerate(("x", "y", "z", "intensity")):
        field = bag.make("sensor_msgs/PointField")
        field.name, field.offset, field.datatype, field.count = name, 4 * index, _FLOAT32, 1
        message.fields.append(field)
    message.height, message.width, message.point_step, message.row_step = 1, len(points), 16, 16 * len(points)
    message.data, message.is_dense = points.astype("<f4").ravel().view(np.uint8), True
    return message


def _grid(bag: McapWriter, stamp_ns: int, mission: Mission) -> Any:
    nothing = mission.blocks.take(np.zeros(len(mission.blocks), dtype=bool))
    raster = occupancy(mission.blocks, nothing, -np.inf, np.inf)
    message = _stamped(bag, "nav_msgs/OccupancyGrid", stamp_ns)
    message.info.resolution = raster.resolution
    message.info.height, message.info.width = raster.values.shape
    message.info.origin.position.x, message.info.origin.position.y = map(float, raster.origin)
    message.info.origin.orientation.w = 1.0
    message.data = raster.values.ravel()
    return message


def _picture(bag: McapWriter, stamp_ns: int, picture: File) -> Any:
    message = _stamped(bag, "sensor_msgs/CompressedImage", stamp_ns)
    message.format, message.data = "png", np.frombuffer(picture.read_bytes(), dtype=np.uint8)
    return message


def _path(bag: McapWriter, stamp_ns: int, path: Path) -> Any:
    message = _stamped(bag, "nav_msgs/Path", stamp_ns)
    for time, pose in zip(path.times, path.poses):
        one = _stamped(bag, "geometry_msgs/PoseStamped", round(time * 1e9))
        _fill(one.pose.position, one.pose.orientation, pose)
        message.poses.append(one)
    return message


def _checks(bag: McapWriter, stamp_ns: int, mission: Mission) -> Any:
    message = _stamped(bag, "diagnostic_msgs/DiagnosticArray", stamp_ns, "")
    message.status.append(_status(bag, "trust", 0, mission.headline))
    for verdict in mission.verdicts:
        message.status.append(_status(bag, verdict.name, _LEVELS[verdict.answer], verdict.line()))
    return message


def _status(bag: McapWriter, name: str, level: int, text: str) -> Any:
    status = bag.make("diagnostic_msgs/DiagnosticStatus")
    status.name, status.level, status.message = name, level, text
    return status


def _poses(bag: McapWriter, mission: Mission) -> List[Any]:
    """Return the pose with its covariance, the transform and the doubts at each time that the solver speaks of."""
    told, best = mission.uncertainty, mission.best
    if told is None:
        return []
    columns = [np.interp(told.times, best.times, axis) for axis in (*best.poses.T[:2], *np.unwrap(best.poses.T[2:]))]
    found = []
    for time, pose, covariance in zip(told.times, np.column_stack(columns), told.covariances):
        stamp = round(float(time) * 1e9)
        odometry = _stamped(bag, "nav_msgs/Odometry", stamp)
        odometry.child_frame_id = _VEHICLE
        _fill(odometry.pose.pose.position, odometry.pose.pose.orientation, pose)
        odometry.pose.covariance[[0, 1, 6, 7]] = covariance.ravel()
        transform = _stamped(bag, "geometry_msgs/TransformStamped", stamp)
        transform.child_frame_id = _VEHICLE
        _fill(transform.transform.translation, transform.transform.rotation, pose)
        tree = bag.make("tf2_msgs/TFMessage")
        tree.transforms.append(transform)
        found += [
            (stamp, "/pose", odometry),
            (stamp, "/tf", tree),
            (stamp, "/checks/now", _doubts(bag, stamp, mission)),
        ]
    return found


def _doubts(bag: McapWriter, stamp_ns: int, mission: Mission) -> Any:
    """Return which checks find that moment doubtful."""
    message = _stamped(bag, "diagnostic_msgs/DiagnosticArray", stamp_ns, "")
    for verdict in mission.verdicts:
        begins, ends = verdict.doubtful.T * 1e9
        is_doubtful = bool(((begins <= stamp_ns) & (stamp_ns <= ends)).any())
        elsewhere = Answer.NOT_MEASURED if verdict.answer is Answer.NOT_MEASURED else Answer.FINE
        answer = Answer.DOUBTFUL if is_doubtful else elsewhere
        message.status.append(_status(bag, verdict.name, _LEVELS[answer], answer.value))
    return message


def _scans(bag: McapWriter, mission: Mission) -> List[Any]:
    found = []
    for scan in mission.scans:
        stamp, flat = round(scan.time * 1e9), np.pad(scan.points, ((0, 0), (0, 2)), mode="constant")
        found.append((stamp, "/scan", _cloud(bag, stamp, flat)))
    return found


def _fill(place: Any, turn: Any, pose: np.ndarray) -> None:
    place.x, place.y = float(pose[0]), float(pose[1])
    yaw = float(pose[2]) if len(pose) > 2 else 0.0
    turn.z, turn.w = float(np.sin(yaw / 2.0)), float(np.cos(yaw / 2.0))
