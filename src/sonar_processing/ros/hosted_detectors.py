"""line_detector and circle_detector within the process that makes their clouds."""

import threading
from collections import deque
from typing import Callable, Deque

import rospy

from node_support.ros.callbacks import guarded
from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.shape_detectors import CircleDetectorNode, LineDetectorNode, ShapeDetectorNode

_DETECTORS = {kind.name: kind for kind in (LineDetectorNode, CircleDetectorNode)}
_WAITING = 10  # clouds: as many as wait for a detector that is a node of its own
_WAIT = 0.5  # s: clouds wake the thread; this is for shutdown alone


class HostedDetector:
    """A detector with a thread of its own: neither beams nor map wait until it is done, or until tf answers it."""

    @classmethod
    def named(cls, name: str) -> "HostedDetector":
        """Return a detector with the parameters and topics it has as a node.

        Raises KeyError for an unknown name and ParameterError for a bad parameter.
        """
        return cls(_DETECTORS[name](rospy.resolve_name(name)))

    def __init__(self, detector: ShapeDetectorNode) -> None:
        self.health = detector.health
        self.input_topic = detector.input_topic
        self._detector = detector
        self._process: Callable[[IntensityCloud], None] = guarded(detector.health, detector.process)
        self._clouds: Deque[IntensityCloud] = deque()
        self._condition = threading.Condition()
        threading.Thread(target=self._work, daemon=True).start()

    @property
    def is_read(self) -> bool:
        """Whether anybody listens to what the detector finds; otherwise it gets no clouds."""
        return self._detector.is_read

    def take(self, cloud: IntensityCloud) -> None:
        """Queue a cloud; returns at once. The oldest one that waits goes when there are too many."""
        with self._condition:
            if len(self._clouds) == _WAITING:
                self._clouds.popleft()
                self.health.problem("clouds dropped", f"{_WAITING} newer ones wait, the machine is too slow")
            self._clouds.append(cloud)
            self._condition.notify()

    def _work(self) -> None:
        while not rospy.core.is_shutdown_requested():
            with self._condition:
                self._condition.wait_for(lambda: self._clouds, _WAIT)
                cloud = self._clouds.popleft() if self._clouds else None
            if cloud is not None:
                self._process(cloud)
