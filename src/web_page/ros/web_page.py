"""The ROS side of web_page: beams, fixes, map and diagnostics in; marks out; the rest goes to browsers."""

from typing import List, Optional

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import Marker, MarkerArray

from georeferencing.chart_files import marks_geojson
from georeferencing.origin import EAST_DEG, Origin
from node_support import topics
from node_support.errors import RefusedInput
from node_support.files import package_folder
from node_support.health import HealthReport
from node_support.marks import Mark
from node_support.ros.callbacks import every, guarded, make_health
from node_support.ros.node import StartError
from node_support.ros.reconfigurable_parameters import read_parameters
from node_support.ros.transforms import TfBuffer
from sonar_processing.beams.beam import Beam
from sonar_processing.ros.beam_subscriber import BeamSubscriber
from sonar_processing.ros.conversions import header, points_from_message
from underwater_map_construction.msg import PositionStatus
from web_page.board import Board
from web_page.messages import MarkRequest
from web_page.parameters import WebPageParameters
from web_page.scene import Scene
from web_page.server import PageServer, Served
from web_page.stages import Stages

_PERIOD = 0.25  # s: positions of a slow vehicle
_CELL = "mlsm_core/resolution"
_USUAL_CELL = 0.5  # m
_MAP_BUFFER = 2**24  # bytes of half a million blocks; rospy reads a message that is larger in pieces, slowly
_MARKS_QUEUE = 100


class WebPage:
    """Shows what comes on topics to all who open the page."""

    def __init__(self) -> None:
        """Raises ParameterError, and StartError where the port cannot be had."""
        self.health = make_health("web_page")
        self._parameters = parameters = read_parameters(WebPageParameters, "~")
        self._origin: Optional[Origin] = None
        self._marks: List[Mark] = []
        self.board = Board()
        self._scene = Scene(parameters, self.board, rospy.resolve_name(topics.BEAMS))
        self._stages = Stages(self.board)
        self._transforms = TfBuffer(self.health)
        self._asked = rospy.Publisher(topics.SET_MARK, Marker, queue_size=_MARKS_QUEUE)
        self._subscribe()
        try:
            served = Served(
                self.board,
                chart=lambda: marks_geojson(self._marks, self._origin),
                ask=self._ask,
                refuse=lambda refused: self.health.problem(refused.kind, str(refused)),
            )
            server = PageServer(served, parameters, package_folder() / "web")
        except OSError as error:
            at = f"{parameters.host}:{parameters.port}"
            raise StartError(f"cannot serve {at}: {error}; set host and port") from None
        rospy.loginfo("%s: http://%s:%d", self.health.name, parameters.host, server.port)
        every(_PERIOD, self._look, self.health)

    def _subscribe(self) -> None:
        self._beams = BeamSubscriber(self._take_beam, self._parameters, self.health)
        for topic, kind, take, options in (
            (topics.MATCHED_POSE, PoseWithCovarianceStamped, self._take_fix, {}),
            (topics.POSITION_STATUS, PositionStatus, self._take_status, {}),
            (topics.MAP_CLOUD, PointCloud2, self._take_map, {"buff_size": _MAP_BUFFER}),
            (topics.MARKS, MarkerArray, self._take_marks, {}),
            (topics.MAP_ORIGIN, Float64MultiArray, self._take_origin, {}),
            ("/diagnostics", DiagnosticArray, self._take_diagnostics, {}),
        ):
            rospy.Subscriber(topic, kind, guarded(self.health, take), queue_size=_MARKS_QUEUE, **options)

    def _ask(self, request: MarkRequest) -> None:
        """Ask mlsm_core to set or delete a mark; what it answers on MLSM/marks is what pages show."""
        if self._asked.get_num_connections() == 0:
            raise RefusedInput("requests refused", "mlsm_core, which keeps the marks, does not run")
        asked = Marker(header=header(0, self._parameters.map_frame))
        asked.text = request.name
        if isinstance(request, Mark):
            asked.action = Marker.ADD
            asked.pose.position.x, asked.pose.position.y = request.x, request.y
            self.health.count("marks set")
        else:
            asked.action = Marker.DELETE
            self.health.count("marks deleted")
        self._asked.publish(asked)

    def _look(self) -> None:
        now = rospy.get_time()
        newest = self._transforms.newest(self._parameters.map_frame, self._parameters.base_frame)
        with self.board.lock, self.health.timed():
            if newest is not None and now:
                self._scene.take_pose(now, newest[1])
            self._scene.tell_now(now)
        self.health.show("pages open", str(self.board.pages))

    def _take_beam(self, beam: Beam) -> None:
        frames = self._parameters.base_frame, self._parameters.map_frame
        found = (self._transforms.newest(frame, beam.frame_id) for frame in frames)
        T_base_sonar, T_map_sonar = (np.eye(4) if one is None else one[1] for one in found)
        with self.board.lock:
            self._scene.take_beam(beam, T_base_sonar, T_map_sonar)

    def _take_fix(self, fix: PoseWithCovarianceStamped) -> None:
        covariance = np.reshape(fix.pose.covariance, (6, 6))[np.ix_([0, 1, 5], [0, 1, 5])]
        at = fix.pose.pose.position
        place = np.array([at.x, at.y])
        if not (np.isfinite(place).all() and np.isfinite(covariance).all()):
            raise RefusedInput("fixes refused", f"at {place}, must be finite")
        with self.board.lock:
            self._scene.take_fix(rospy.get_time(), place, covariance)

    def _take_status(self, status: PositionStatus) -> None:
        covariance = np.reshape(status.covariance, (3, 3))
        with self.board.lock:
            self._scene.take_status(status.state, status.text, status.age, covariance)

    def _take_map(self, cloud: PointCloud2) -> None:
        rows = points_from_message(cloud, ("x", "y", "count"))
        cell = self._parameters.cell or float(rospy.get_param(_CELL, _USUAL_CELL))
        self.health.count("maps in")
        with self.board.lock, self.health.timed():
            self._scene.take_map(rospy.get_time(), rows[:, :2], rows[:, 2], cell)

    def _take_marks(self, message: MarkerArray) -> None:
        marks = [
            Mark(one.text, one.pose.position.x, one.pose.position.y, one.pose.position.z)
            for one in message.markers
            if one.action == Marker.ADD and one.text
        ]
        with self.board.lock:
            self._marks = marks
            self._scene.take_marks(marks)

    def _take_origin(self, message: Float64MultiArray) -> None:
        origin = Origin.of_array(np.array(message.data)) if message.data else None
        with self.board.lock:
            self._origin = origin
            self._scene.take_azimuth(EAST_DEG if origin is None else origin.azimuth_deg)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        with self.board.lock:
            for one in message.status:
                # Levels are bytes in Python 3.
                level = one.level if isinstance(one.level, int) else ord(one.level or b"\0")
                values = {pair.key: pair.value for pair in one.values}
                self._stages.take(one.name, HealthReport(level, one.message, values))
