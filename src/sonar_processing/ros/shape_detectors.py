"""The ROS side of line_detector and circle_detector: clouds in, shapes and markers out (thesis 6.5.5)."""

from abc import ABC, abstractmethod
from typing import Any, Sequence, Tuple

import numpy as np
import rospy
from visualization_msgs.msg import MarkerArray

from node_support import topics
from node_support.errors import RefusedInput
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.conversions import StampedIntensityCloudArrays, cloud_from_message
from sonar_processing.ros.publishers import PointsPublisher
from sonar_processing.ros.shape_messages import circle_markers, circles_message, wall_markers, walls_message
from sonar_processing.ros.sonar_places import SonarPlaces
from sonar_processing.ros.subscribers import subscribe_to_clouds
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_processing.shapes.lines import LineDetector, LineDetectorParameters
from sonar_processing.shapes.ransac import RansacParameters
from underwater_map_construction.msg import Circles, Walls

QUEUE_SIZE = 10


class ShapeDetectorNode(ABC):
    """What both detectors share; `_detect` finds the shapes of a scan and says how they are shown."""

    name: str
    input_topic: str
    topic: str
    what: str
    config_name: str
    parameters: type
    message: type

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health(self.name)
        self.healths = [self.health]
        self._live = ReconfigurableParameters(
            self.parameters, namespace, self.config_name, self.health, self._use_parameters
        )
        self._places = SonarPlaces(self._live.current.sonar_frame, self.health, self._live.current.stamp_tolerance)
        self._inliers = PointsPublisher(self.topic)
        self._coefficients = rospy.Publisher(f"{self.topic}/coefficients", self.message, queue_size=QUEUE_SIZE)
        self._markers = rospy.Publisher(f"{self.topic}/markers", MarkerArray, queue_size=QUEUE_SIZE)

    @classmethod
    def as_node(cls) -> "ShapeDetectorNode":
        """Return the detector as a node of its own, which takes clouds from its input topic."""
        detector = cls()

        def take(message: StampedIntensityCloudArrays) -> None:
            detector.process(cloud_from_message(message))

        subscribe_to_clouds(cls.input_topic, guarded(detector.health, take))
        return detector

    @property
    def is_read(self) -> bool:
        """Whether anybody listens to any of the detector's topics."""
        publishers = (self._coefficients, self._markers)
        return self._inliers.is_read or any(publisher.get_num_connections() for publisher in publishers)

    @abstractmethod
    def _use_parameters(self, parameters: RansacParameters) -> None:
        """Make the detector anew."""

    @abstractmethod
    def _detect(self, cloud: IntensityCloud) -> Tuple[Sequence[Any], Any, MarkerArray]:
        """Return the shapes of a scan, the message that holds them, and how rviz shows them."""

    def process(self, cloud: IntensityCloud) -> None:
        """Detect the shapes of a scan and publish them. Raises RefusedInput for a scan that cannot be used."""
        self.health.count("clouds in")
        self.health.count("points in", len(cloud))
        if cloud.broken:
            self.health.problem(
                "points that are not finite", f"{cloud.broken} of {len(cloud)} in a cloud", cloud.broken
            )
        self._places.check_stamp(cloud.stamp_ns)
        with self.health.timed():
            shapes, coefficients, markers = self._detect(cloud)
        self.health.count(f"{self.what} out", len(shapes))
        self._coefficients.publish(coefficients)
        self._markers.publish(markers)
        self._inliers.publish(_part(cloud, shapes))


class LineDetectorNode(ShapeDetectorNode):
    """line_detector."""

    name, input_topic, topic = "line_detector", topics.CLEANED, topics.LINES
    what, config_name = "walls", "LineDetector"
    parameters, message = LineDetectorParameters, Walls

    def _use_parameters(self, parameters: LineDetectorParameters) -> None:
        self._detector = LineDetector(parameters)

    def _detect(self, cloud: IntensityCloud) -> Tuple[Sequence[Any], Walls, MarkerArray]:
        lines = self._detector(cloud)
        walls = walls_message(cloud, lines, self._sonar(cloud))
        return lines, walls, wall_markers(walls)

    def _sonar(self, cloud: IntensityCloud) -> np.ndarray:
        try:
            return self._places.at(cloud.frame_id, np.array([cloud.stamp_ns * 1e-9]))[0]
        except RefusedInput as refused:
            self.health.problem(refused.kind, str(refused))
            return np.full(2, np.nan)


class CircleDetectorNode(ShapeDetectorNode):
    """circle_detector."""

    name, input_topic, topic = "circle_detector", topics.THRESHOLDED, topics.CIRCLES
    what, config_name = "circles", "CircleDetector"
    parameters, message = CircleDetectorParameters, Circles

    def _use_parameters(self, parameters: CircleDetectorParameters) -> None:
        self._detector = CircleDetector(parameters)

    def _detect(self, cloud: IntensityCloud) -> Tuple[Sequence[Any], Circles, MarkerArray]:
        circles = self._detector(cloud, lambda times: self._places.at(cloud.frame_id, times))
        message = circles_message(cloud, circles)
        return circles, message, circle_markers(message)


def _part(cloud: IntensityCloud, shapes: Sequence[Any]) -> IntensityCloud:
    members = np.concatenate([np.zeros(0, dtype=np.int64), *(shape.members for shape in shapes)])
    keep = np.zeros(len(cloud), dtype=bool)
    keep[members] = True
    return cloud.select(keep)
