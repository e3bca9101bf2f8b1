"""A mission as an MCAP file of standard messages of ROS 2, for Foxglove and other programs that know no package."""

from pathlib import Path as File
from typing import Any, List, Sequence, Tuple

import numpy as np

from mlsm_manager.report.mission import Mission, Path
from mlsm_manager.self_check.verdict import Answer, RunAnswer
from mlsm_manager.surface_map.export.rasters import occupancy
from node_support.files import whole_file
from recordings.bags.messages import Placing, write_pose
from recordings.bags.writers import McapWriter

_MAP, _VEHICLE = "map", "base_link"
_FLOAT32 = 7  # of PointField
_OK, _WARN, _STALE = 0, 1, 3  # of DiagnosticStatus
_LEVELS = {Answer.FINE: _OK, Answer.DOUBTFUL: _WARN, Answer.NOT_MEASURED: _STALE}
_LEVELS_OF_RUNS = {
    RunAnswer.FINE: _OK, RunAnswer.PARTLY: _STALE, RunAnswer.UNMEASURED: _STALE, RunAnswer.DOUBTFUL: _WARN,
}  # fmt: skip
_Told = Tuple[str, int, str]
"""Name, level and text of a DiagnosticStatus."""


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
        shown = bag.stamped("sensor_msgs/CompressedImage", bag.time(start), _MAP)
        shown.format, shown.data = "png", np.frombuffer(picture.read_bytes(), dtype=np.uint8)
        bag.write("/map/picture", shown, start)
        for path in (*mission.paths, *mission.further):
            bag.write(f"/path/{path.name.replace(' ', '_').replace(',', '')}", _path(bag, start, path), start)
        checks = [(verdict.name, _LEVELS[verdict.answer], verdict.line()) for verdict in mission.verdicts]
        trust = "trust", _LEVELS_OF_RUNS[mission.answer], mission.headline
        bag.write("/checks", _diagnostics(bag, start, [trust, *checks]), start)
        stamped = _poses(bag, mission)
        for scan in mission.scans:
            stamp, flat = round(scan.time * 1e9), np.pad(scan.points, ((0, 0), (0, 2)), mode="constant")
            stamped.append((stamp, "/scan", _cloud(bag, stamp, flat)))
        for stamp_ns, topic, message in sorted(stamped, key=lambda one: one[0]):
            bag.write(topic, message, stamp_ns)


def _cloud(bag: McapWriter, stamp_ns: int, points: np.ndarray) -> Any:
    """Return a PointCloud2 of points (n, 4): x y z [m] and echo strength."""
    message = bag.stamped("sensor_msgs/PointCloud2", bag.time(stamp_ns), _MAP)
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
    message = bag.stamped("nav_msgs/OccupancyGrid", bag.time(stamp_ns), _MAP)
    message.info.resolution = raster.resolution
    message.info.height, message.info.width = raster.values.shape
    message.info.origin.position.x, message.info.origin.position.y = map(float, raster.origin)
    message.info.origin.orientation.w = 1.0
    message.data = raster.values.ravel()
    return message


def _path(bag: McapWriter, stamp_ns: int, path: Path) -> Any:
    message = bag.stamped("nav_msgs/Path", bag.time(stamp_ns), _MAP)
    for time, pose in zip(path.times, path.poses):
        one = bag.stamped("geometry_msgs/PoseStamped", bag.time(round(time * 1e9)), _MAP)
        write_pose(one.pose.position, one.pose.orientation, _placing(pose))
        message.poses.append(one)
    return message


def _poses(bag: McapWriter, mission: Mission) -> List[Any]:
    """Return the pose with its covariance, the transform and the doubts at each time that the solver speaks of."""
    told, best = mission.uncertainty, mission.best
    if told is None:
        return []
    columns = [np.interp(told.times, best.times, axis) for axis in (*best.poses.T[:2], *np.unwrap(best.poses.T[2:]))]
    found = []
    for time, pose, covariance in zip(told.times, np.column_stack(columns), told.covariances):
        stamp = round(float(time) * 1e9)
        odometry = bag.odometry(_placing(pose), bag.time(stamp), _MAP, _VEHICLE)
        odometry.pose.covariance[[0, 1, 6, 7]] = covariance.ravel()
        tree = bag.transforms([bag.transform(_placing(pose), bag.time(stamp), _MAP, _VEHICLE)])
        found += [
            (stamp, "/pose", odometry),
            (stamp, "/tf", tree),
            (stamp, "/checks/now", _diagnostics(bag, stamp, _doubts(stamp, mission))),
        ]
    return found


def _doubts(stamp_ns: int, mission: Mission) -> List[_Told]:
    """Return which checks find that moment doubtful."""
    told = []
    for verdict in mission.verdicts:
        begins, ends = verdict.doubtful.T * 1e9
        is_doubtful = bool(((begins <= stamp_ns) & (stamp_ns <= ends)).any())
        elsewhere = Answer.NOT_MEASURED if verdict.answer is Answer.NOT_MEASURED else Answer.FINE
        answer = Answer.DOUBTFUL if is_doubtful else elsewhere
        told.append((verdict.name, _LEVELS[answer], answer.value))
    return told


def _diagnostics(bag: McapWriter, stamp_ns: int, told: Sequence[_Told]) -> Any:
    message = bag.stamped("diagnostic_msgs/DiagnosticArray", bag.time(stamp_ns), "")
    for name, level, text in told:
        status = bag.make("diagnostic_msgs/DiagnosticStatus")
        status.name, status.level, status.message = name, level, text
        message.status.append(status)
    return message


def _placing(pose: np.ndarray) -> Placing:
    yaw = float(pose[2]) if len(pose) > 2 else 0.0
    turn = [0.0, 0.0, float(np.sin(yaw / 2.0)), float(np.cos(yaw / 2.0))]
    return Placing([float(pose[0]), float(pose[1]), 0.0], turn)
