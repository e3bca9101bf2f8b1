"""The ROS side of line_detector and circle_detector: clouds in, shapes and markers out (thesis 6.5.5)."""

import threading
from abc import ABC, abstractmethod
from collections import deque
from typing import Any, Callable, Deque, Sequence, Tuple

import numpy as np
import rospy
from visualization_msgs.msg import MarkerArray

from node_support import topics
from node_support.errors import RefusedInput
from node_support.ros.callbacks import guarded, make_health, on_change
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from sonar_processing.cloud import Cloud, CloudSink
from sonar_processing.ros.cloud_topics import PointsPublisher, SonarPlaces, report_broken, subscribe_to_clouds
from sonar_processing.ros.shape_messages import circle_markers, circles_message, wall_markers, walls_message
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_processing.shapes.lines import LineDetector, LineDetectorParameters
from sonar_processing.shapes.ransac import RansacParameters
from underwater_map_construction.msg import Circles, Walls

QUEUE_SIZE = 10
_WAITING = 10  # clouds: as many as wait for a detector that is a node of its own


class ShapeDetectorNode(ABC):
    """What both detectors share; `_detect` finds the shapes of a scan and says how they are shown."""

    name: str
    input_topic: str
    topic: str
    what: str
    parameters: type
    detector: type
    message: type

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health(self.name)
        self._live = ReconfigurableParameters(self.parameters, namespace, self.health, self._use_parameters)
        self._places = SonarPlaces(self._live.current.sonar_frame, self.health, self._live.current.stamp_tolerance)
        self._inliers = PointsPublisher(self.topic)
        self._coefficients = rospy.Publisher(f"{self.topic}/coefficients", self.message, queue_size=QUEUE_SIZE)
        self._markers = rospy.Publisher(f"{self.topic}/markers", MarkerArray, queue_size=QUEUE_SIZE)

    @classmethod
    def as_node(cls) -> "ShapeDetectorNode":
        """Return the detector as a node of its own, which takes clouds from its input topic."""
        detector = cls()
        subscribe_to_clouds(cls.input_topic, detector.process, detector.health)
        return detector

    def sink(self) -> CloudSink:
        """Return where the process that hosts the detector hands its clouds to."""
        return CloudSink(DetectorQueue(self).take, lambda: self.is_read)

    @property
    def is_read(self) -> bool:
        """Whether anybody listens to any of the detector's topics; a hosted one gets no clouds otherwise."""
        publishers = (self._coefficients, self._markers)
        return self._inliers.is_read or any(publisher.get_num_connections() for publisher in publishers)

    def _use_parameters(self, parameters: RansacParameters) -> None:
        self._detector = self.detector(parameters)

    @abstractmethod
    def _detect(self, cloud: Cloud) -> Tuple[Sequence[Any], Any, MarkerArray]:
        """Return the shapes of a scan, the message that holds them, and how rviz shows them."""

    def process(self, cloud: Cloud) -> None:
        """Detect the shapes of a scan and publish them. Raises RefusedInput for a scan that cannot be used."""
        self.health.count("clouds in")
        self.health.count("points in", len(cloud))
        report_broken(cloud, self.health)
        self._places.transforms.check_stamp(cloud.stamp_ns)
        with self.health.timed():
            shapes, coefficients, markers = self._detect(cloud)
        self.health.count(f"{self.what} out", len(shapes))
        self._coefficients.publish(coefficients)
        self._markers.publish(markers)
        members = np.concatenate([np.zeros(0, dtype=np.int64), *(shape.members for shape in shapes)])
        self._inliers.publish(cloud.take(np.unique(members)))


class LineDetectorNode(ShapeDetectorNode):
    name, input_topic, topic = "line_detector", topics.CLEANED, topics.LINES
    what = "walls"
    parameters, detector, message = LineDetectorParameters, LineDetector, Walls

    def _detect(self, cloud: Cloud) -> Tuple[Sequence[Any], Walls, MarkerArray]:
        lines = self._detector(cloud)
        walls = walls_message(cloud, lines, self._sonar(cloud))
        return lines, walls, wall_markers(walls)

    def _sonar(self, cloud: Cloud) -> np.ndarray:
        try:
            return self._places.at(cloud.frame_id, np.array([cloud.stamp_ns * 1e-9]))[0]
        except RefusedInput as refused:
            self.health.problem(refused.kind, str(refused))
            return np.full(2, np.nan)


class CircleDetectorNode(ShapeDetectorNode):
    name, input_topic, topic = "circle_detector", topics.THRESHOLDED, topics.CIRCLES
    what = "circles"
    parameters, detector, message = CircleDetectorParameters, CircleDetector, Circles

    def _detect(self, cloud: Cloud) -> Tuple[Sequence[Any], Circles, MarkerArray]:
        circles = self._detector(cloud, lambda times: self._places.at(cloud.frame_id, times))
        message = circles_message(cloud, circles)
        return circles, message, circle_markers(message)


DETECTORS = {kind.name: kind for kind in (LineDetectorNode, CircleDetectorNode)}


class DetectorQueue:
    """A thread of its own for a detector that is hosted: neither beams nor map wait until it is done, or for its tf."""

    def __init__(self, detector: ShapeDetectorNode) -> None:
        self._health = detector.health
        self._process: Callable[[Cloud], None] = guarded(detector.health, detector.process)
        self._clouds: Deque[Cloud] = deque(maxlen=_WAITING)
        self._lock = threading.Lock()
        self._notify = on_change(0.0, self._work, detector.health)

    def take(self, cloud: Cloud) -> None:
        """Queue a cloud; returns at once. The oldest one that waits goes when there are too many."""
        with self._lock:
            if len(self._clouds) == _WAITING:
                self._health.problem("clouds dropped", f"{_WAITING} newer ones wait, the machine is too slow")
            self._clouds.append(cloud)
        self._notify()

    def _work(self) -> None:
        while self._clouds and not rospy.core.is_shutdown_requested():
            with self._lock:
                cloud = self._clouds.popleft()
            self._process(cloud)
