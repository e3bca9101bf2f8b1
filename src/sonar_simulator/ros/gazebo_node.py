"""The node gazebo_sonar: makes beams of the scans of Gazebo's ray sensors."""

import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, Optional, Tuple, Type

import numpy as np
import rospy
from genpy import DeserializationError, Message
from rospy import AnyMsg
from sensor_msgs.msg import LaserScan, PointCloud, PointCloud2, PointField

from node_support import topics
from node_support.errors import RefusedInput
from node_support.geometry import yaw_of
from node_support.headers import check_frame, check_stamp
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.node import run
from node_support.ros.transforms import JointAngle
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.ros.conversions import POINT_FIELDS, header, points_from_message
from sonar_processing.ros.transform_filter import TransformFilter
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.ray_grid import Rays, contacts_of_grid, rays_of_points, rays_of_scan
from sonar_simulator.gazebo_parameters import GROUPS, GazeboSonarParameters, HeadMode
from sonar_simulator.ros.publisher import MESSAGES
from sonar_simulator.simulation.simulation import Ping
from sonar_simulator.simulation.sonar_head import SonarHead
from underwater_map_construction.msg import SonarScanLine


@dataclass(frozen=True)
class RayScan:
    """One scan of a ray sensor: its rays, its stamp in ns and its frame."""

    rays: Rays
    stamp_ns: int
    frame_id: str


def ray_scan(message: AnyMsg, parameters: GazeboSonarParameters) -> RayScan:
    """Return the scan in a message of one of the three types; raises RefusedInput for one that cannot be used."""
    kind = message._connection_header["type"]
    if kind not in _CONVERSIONS:
        raise RefusedInput("scans refused", f"type {kind}, must be one of {', '.join(_CONVERSIONS)}")
    made, rays_of = _CONVERSIONS[kind]
    try:
        typed = made().deserialize(message._buff)
    except DeserializationError as error:
        raise RefusedInput("scans refused", f"{kind}: {error}") from error
    stamp_ns, frame_id = typed.header.stamp.to_nsec(), typed.header.frame_id.lstrip("/")
    check_stamp(stamp_ns)
    check_frame(frame_id, "scans refused")
    return RayScan(rays_of(typed, parameters), stamp_ns, frame_id)


def _of_point_cloud(cloud: PointCloud, parameters: GazeboSonarParameters) -> Rays:
    points = np.array([(point.x, point.y, point.z) for point in cloud.points]).reshape(-1, 3)
    # gazebo_ros_block_laser leaves the name of its only channel empty.
    values = [channel.values for channel in cloud.channels if len(channel.values) == len(points)]
    intensities = np.asarray(values[0]) if values else None
    return rays_of_points(points, intensities, parameters.ray_rows, parameters.nothing_range)


def _of_point_cloud2(cloud: PointCloud2, parameters: GazeboSonarParameters) -> Rays:
    floats = [field.name for field in cloud.fields if field.datatype == PointField.FLOAT32]
    has_intensity = POINT_FIELDS[3] in floats
    columns = points_from_message(cloud, POINT_FIELDS if has_intensity else POINT_FIELDS[:3], "scans refused")
    columns, rows = columns.astype(np.float64), parameters.ray_rows or (cloud.height if cloud.height > 1 else 0)
    return rays_of_points(columns[:, :3], columns[:, 3] if has_intensity else None, rows, parameters.nothing_range)


_CONVERSIONS: Dict[str, Tuple[Type[Message], Callable[[Any, GazeboSonarParameters], Rays]]] = {
    LaserScan._type: (LaserScan, lambda scan, told: rays_of_scan(scan, math.radians(told.vertical_opening_deg))),
    PointCloud._type: (PointCloud, _of_point_cloud),
    PointCloud2._type: (PointCloud2, _of_point_cloud2),
}
# A scan of 100,000 rays several times over; rospy reads one that is larger in pieces, slowly.
_SCAN_BUFFER_BYTES = 2**23
_ANY_TIME = 1.0  # s: Gazebo says when the next scan comes, so the head's own period does not count


class GazeboSonar:
    """Subscribes to sonar/rays, publishes sonar/raw."""

    def __init__(self) -> None:
        """Raises ParameterError."""
        self.health = make_health("gazebo_sonar")
        values = dict(rospy.get_param("~", {}))
        groups = {name: kind.from_group(name, values.pop(name, {})) for name, kind in GROUPS.items()}
        self._parameters = GazeboSonarParameters.from_mapping(values)
        name = self._parameters.echo_model.value
        self._model = make_echo_model(name, groups[name].to_mapping())
        self._rng = np.random.default_rng(self._parameters.seed)
        self._head = SonarHead(self._parameters.beams_per_turn, _ANY_TIME)
        self._next_beam = 0
        self._publisher = rospy.Publisher(topics.BEAMS, SonarScanLine, queue_size=100, tcp_nodelay=True)
        self._filter: Optional[TransformFilter] = None
        if self._parameters.head is HeadMode.JOINT:
            frame, tolerance = self._parameters.frame_id, self._parameters.stamp_tolerance
            self._filter = TransformFilter(frame, self.health, self._turned, lambda: None, tolerance)
        self._tilt = JointAngle(self._parameters.sensor_joint, self.health)
        rospy.Subscriber(
            topics.RAYS, rospy.AnyMsg, guarded(self.health, self._take_scan), queue_size=10,
            buff_size=_SCAN_BUFFER_BYTES, tcp_nodelay=True,
        )  # fmt: skip

    def _take_scan(self, message: rospy.AnyMsg) -> None:
        self.health.count("scans in")
        scan = ray_scan(message, self._parameters)
        if self._filter is not None:
            self._filter.add(scan)
            return
        angle, opening = self._head.angle(self._next_beam), math.radians(self._parameters.horizontal_opening_deg)
        rays = scan.rays.within(angle, opening)
        self._next_beam += 1
        self._publish(angle, rays, scan)

    def _turned(self, placed: PlacedBeam) -> None:
        scan: RayScan = placed.beam
        self._publish(yaw_of(placed.T_target_sonar), scan.rays, scan)

    def _publish(self, angle: float, rays: Rays, scan: RayScan) -> None:
        with self.health.timed():
            ping = Ping(angle, self._model.echoes(contacts_of_grid(rays), self._rng)[0])
        head, reach = header(scan.stamp_ns, self._parameters.frame_id), self._model.max_range
        self._publisher.publish(MESSAGES.scan_line(ping, self._tilt.for_beam(), head.stamp, head.frame_id, reach))
        self.health.count("beams out")


def run_gazebo_sonar() -> None:
    run("gazebo_sonar", GazeboSonar)
