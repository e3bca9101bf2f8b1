"""The ROS side of the map: clouds in; markers, cloud, map -> odom and services out (thesis 4.5.1, 6.5.6)."""

import threading

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from mlsm_manager.core_parameters import MlsmCoreParameters
from mlsm_manager.map_publisher import MapPublisher
from mlsm_manager.map_transform import MapTransform
from mlsm_manager.mlsm import InsertReport, MultiLevelSurfaceMap
from mlsm_manager.storage import map_path, write_ply
from node_support.live_parameters import LiveParameters
from node_support.node import every, guarded, make_health
from node_support.refused_input import RefusedInput
from sonar_processing.cloud import IntensityCloud
from sonar_processing.conversions import StampedIntensityCloudArrays, cloud_from_message
from sonar_processing.stage_runner import subscribe_to_clouds
from underwater_map_construction.srv import SaveMap, SaveMapRequest, SaveMapResponse


class MlsmCore:
    """Inserts clouds into the map and keeps the world informed of it."""

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health("mlsm_core")
        self._lock = threading.Lock()
        self._changed = False
        self._stamp_ns = 0
        self._live = LiveParameters(MlsmCoreParameters, namespace, "MlsmCore", self.health, lambda _: None)
        self._map = self._empty_map()
        self._publisher = MapPublisher(self._live.current.map_frame)
        self._transform = MapTransform(lambda: self._live.current, self.health)
        prefix = namespace if namespace == "~" else namespace + "/"
        rospy.Service(f"{prefix}save_map", SaveMap, self._save)
        rospy.Service(f"{prefix}reset", Trigger, self._reset)
        every(self._live.current.map_period, self._publish_if_changed, self.health)

    def subscribe(self) -> None:
        """Take clouds from sonar/scan/cleaned."""

        def take(message: StampedIntensityCloudArrays) -> None:
            self.insert(cloud_from_message(message))

        subscribe_to_clouds("sonar/scan/cleaned", guarded(self.health, take))

    def insert(self, cloud: IntensityCloud) -> None:
        """Insert a cloud; one that cannot be placed in the map is counted and left out."""
        guarded(self.health, self._insert)(cloud)

    def _insert(self, cloud: IntensityCloud) -> None:
        self.health.count("clouds in")
        self.health.count("points in", len(cloud))
        parameters = self._live.current
        if cloud.frame_id not in (parameters.odom_frame, parameters.map_frame):
            raise RefusedInput(
                "clouds refused",
                f"frame {cloud.frame_id!r}, must be {parameters.odom_frame!r} or {parameters.map_frame!r}; "
                "set sonar_to_cloud's target_frame",
            )
        with self.health.timed(), self._lock:
            report = self._map.insert(cloud.points[cloud.valid])
            blocks = len(self._map)
            self._stamp_ns = cloud.stamp_ns
            self._changed = True
        self._tell(cloud, report, blocks)

    def _tell(self, cloud: IntensityCloud, report: InsertReport, blocks: int) -> None:
        self.health.count("points inserted", report.inserted)
        self.health.show("blocks", str(blocks))
        if cloud.broken:
            self.health.problem(
                "points that are not finite", f"{cloud.broken} of {len(cloud)} in a cloud", cloud.broken
            )
        if report.outside:
            limit = self._live.current.map_limit
            self.health.problem(
                "points outside the map",
                f"{report.outside} beyond map_limit of {limit:g} m; check tf",
                report.outside,
            )

    def _empty_map(self) -> MultiLevelSurfaceMap:
        parameters = self._live.current
        return MultiLevelSurfaceMap(parameters.resolution, parameters.map_limit, parameters.expected_blocks)

    def _publish_if_changed(self) -> None:
        with self._lock:
            if not self._changed:
                return
            blocks, stamp_ns, self._changed = self._map.blocks, self._stamp_ns, False
        self._publisher.publish(blocks, stamp_ns)

    def _reset(self, _request: TriggerRequest) -> TriggerResponse:
        with self._lock:
            count = len(self._map)
            self._map = self._empty_map()
            self._changed = True
        return TriggerResponse(True, f"{count} blocks forgotten")

    def _save(self, request: SaveMapRequest) -> SaveMapResponse:
        with self._lock:
            blocks = self._map.blocks
        try:
            path = map_path(self._live.current.save_folder, request.name)
            write_ply(path, blocks)
        except (OSError, ValueError) as error:
            return SaveMapResponse(False, str(error))
        return SaveMapResponse(True, f"{len(blocks)} blocks written to {path}")
