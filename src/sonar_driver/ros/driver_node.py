"""The ROS side of every driver: settings in; beams and diagnostics out (thesis 4.5.1)."""

import threading
from abc import ABC, abstractmethod
from typing import Any, Mapping, Optional, Type

import rospy

from node_support import topics
from node_support.headers import check_stamp
from node_support.parameters import ParameterSet
from node_support.ros.callbacks import guarded
from node_support.ros.node import StartError
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import JointAngle
from sonar_driver.line.device import LineDevice
from sonar_driver.line.driver_health import DriverHealth, Problem
from sonar_driver.line.port import PortError
from sonar_driver.line.scanner import Scanner
from sonar_driver.line.stats import LineStats
from underwater_map_construction.msg import SonarScanLine

_LONGEST_STOP = 1.0  # s: a ping at the longest range ends within this time
_PAUSE_AFTER_FAILURE = 1.0  # s: a failure that lasts must not fill the log


class SonarModel(ABC):
    """What the node needs to know of one kind of sonar."""

    name: str
    """The node's name."""
    config_name: str
    """The name of the .cfg file."""
    parameters: Type[ParameterSet]
    """Those of line, mounting and head; `LineParameters` and `MountingParameters` are among its bases."""
    problems: Mapping[str, Problem]
    """The counts of its device that should stay zero, by their fields."""

    @abstractmethod
    def device(self, parameters: Any, stop: threading.Event) -> LineDevice:
        """Return the head on its line, not yet open; its pings are stamped with `rospy.get_time`."""

    @abstractmethod
    def command(self, parameters: Any) -> Any:
        """Return the command of these settings, as the device's `ping` takes it."""

    @abstractmethod
    def message(self, ping: Any, parameters: Any, sensor_angle: float) -> Optional[SonarScanLine]:
        """Return the message of a ping; None if it holds no echoes."""


class DriverNode:
    """Keeps the head pinging, and publishes every valid reply once, in order."""

    def __init__(self, model: SonarModel, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace` and StartError for an unusable port."""
        self._model = model
        self._device: Optional[LineDevice] = None
        self._scanner: Optional[Scanner] = None
        self._stop = threading.Event()
        self._last_stats = LineStats()
        self.health = DriverHealth(model.name, model.problems, lambda line: rospy.logwarn("%s", line), self._stats)
        self.healths = [self.health]
        self._live = ReconfigurableParameters(
            model.parameters, namespace, model.config_name, self.health, self._use_parameters
        )
        self._beams = rospy.Publisher(topics.BEAMS, SonarScanLine, queue_size=200, tcp_nodelay=True)
        self._tilt = JointAngle(self._live.current.sensor_joint, self.health)
        self._connect()
        self._thread = threading.Thread(target=self._scan, daemon=True)
        self._thread.start()
        rospy.on_shutdown(self._end)

    def _stats(self) -> LineStats:
        # A port that is closed because the node ends does not count as lost.
        if self._device is not None and not self._stop.is_set():
            self._last_stats = self._device.stats
        return self._last_stats

    def _use_parameters(self, parameters: ParameterSet) -> None:
        command = self._model.command(parameters)
        if self._scanner is None:
            self._device = self._model.device(parameters, self._stop)
            self._scanner = Scanner(self._device, command, guarded(self.health, self._publish))
        self._scanner.command = command

    def _connect(self) -> None:
        try:
            self._scanner.connect()
        except PortError as error:
            raise StartError(str(error)) from error
        stats = self._stats()
        if not stats.connected:
            rospy.logwarn("%s: %s; waiting for it", self.health.name, stats.last_error)

    def _scan(self) -> None:
        run = guarded(self.health, self._scanner.run)
        while not self._stop.is_set():
            run()
            self._stop.wait(_PAUSE_AFTER_FAILURE)

    def _publish(self, ping: Any) -> None:
        # A ping leaves before its reply comes: with a clock near 0 its stamp is negative, which rospy.Time refuses.
        check_stamp(round(ping.stamp * 1e9))
        message = self._model.message(ping, self._live.current, self._tilt.for_beam())
        if message is not None:
            self._beams.publish(message)
            self.health.count("beams out")

    def _end(self) -> None:
        self._stop.set()
        self._thread.join(_LONGEST_STOP)
