"""The ROS side of every driver: settings in; beams and diagnostics out (thesis 4.5.1)."""

import threading
from dataclasses import dataclass
from typing import Any, Callable, Optional, Type

import rospy

from node_support import topics
from node_support.headers import check_stamp
from node_support.parameters import ParameterSet
from node_support.ros.callbacks import guarded
from node_support.ros.node import StartError
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import JointAngle
from sonar_driver.line.device import LineDevice, Scanner
from sonar_driver.line.driver_health import DriverHealth, LineStats
from sonar_driver.line.port import PortError
from underwater_map_construction.msg import SonarScanLine

_LONGEST_STOP = 1.0  # s: a ping at the longest range ends within this time
_PAUSE_AFTER_FAILURE = 1.0  # s: a failure that lasts must not fill the log


@dataclass(frozen=True)
class SonarModel:
    """What the node needs to know of one kind of sonar.

    name: the node's. parameters: those of line, mounting and head, with a `command`;
    `LineParameters` and `MountingParameters` are among their bases. device: takes parameters, a stop event and a clock.
    message: makes the message of a ping, but for its header and the angle of the servo; None if it holds no echoes.
    """

    name: str
    parameters: Type[ParameterSet]
    device: Callable[[Any, threading.Event, Callable[[], float]], LineDevice]
    message: Callable[[Any, Any], Optional[SonarScanLine]]


class DriverNode:
    """Keeps the head pinging, and publishes every valid reply once, in order."""

    def __init__(self, model: SonarModel, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace` and StartError for an unusable port."""
        self._model = model
        self._device: Optional[LineDevice] = None
        self._scanner: Optional[Scanner] = None
        self._stop = threading.Event()
        self._last_stats = LineStats()
        self.health = DriverHealth(model.name, lambda line: rospy.logwarn("%s", line), self._stats)
        self.healths = [self.health]
        self._live = ReconfigurableParameters(model.parameters, namespace, self.health, self._use_parameters)
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
        command = parameters.command()
        if self._scanner is None:
            self._device = self._model.device(parameters, self._stop, rospy.get_time)
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
        parameters = self._live.current
        message = self._model.message(ping, parameters)
        if message is not None:
            message.header.stamp, message.header.frame_id = rospy.Time.from_sec(ping.stamp), parameters.frame_id
            message.sensorAngle = self._tilt.for_beam()
            self._beams.publish(message)
            self.health.count("beams out")

    def _end(self) -> None:
        self._stop.set()
        self._thread.join(_LONGEST_STOP)
