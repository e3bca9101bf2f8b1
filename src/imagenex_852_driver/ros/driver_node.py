"""The ROS side of the driver: settings in; beams and diagnostics out (thesis 4.5.1)."""

import threading
from typing import Optional

import rospy

from imagenex_852_driver.line.device import Ping, SonarDevice
from imagenex_852_driver.line.driver_health import DriverHealth
from imagenex_852_driver.line.parameters import DriverParameters
from imagenex_852_driver.line.port import PortError
from imagenex_852_driver.line.scanner import Scanner
from imagenex_852_driver.line.stats import DeviceStats
from imagenex_852_driver.ros.messages import scan_line
from node_support import topics
from node_support.headers import check_stamp
from node_support.ros.joint_angle import JointAngle
from node_support.ros.node import StartError, guarded
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from underwater_map_construction.msg import SonarScanLine

_LONGEST_STOP = 1.0  # s: a ping at the longest range ends within this time
_PAUSE_AFTER_FAILURE = 1.0  # s: a failure that lasts must not fill the log


class DriverNode:
    """Keeps the head pinging, and publishes every valid reply once, in order."""

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace` and StartError for an unusable port."""
        self._device: Optional[SonarDevice] = None
        self._scanner: Optional[Scanner] = None
        self._stop = threading.Event()
        self._last_stats = DeviceStats()
        self.health = DriverHealth(lambda line: rospy.logwarn("%s", line), self._stats)
        self.healths = [self.health]
        self._live = ReconfigurableParameters(
            DriverParameters, namespace, "Imagenex852", self.health, self._use_parameters
        )
        self._beams = rospy.Publisher(topics.BEAMS, SonarScanLine, queue_size=200, tcp_nodelay=True)
        self._tilt = JointAngle(self._live.current.sensor_joint, self.health)
        self._connect()
        self._thread = threading.Thread(target=self._scan, daemon=True)
        self._thread.start()
        rospy.on_shutdown(self._end)

    def _stats(self) -> DeviceStats:
        # A port that is closed because the node ends does not count as lost.
        if self._device is not None and not self._stop.is_set():
            self._last_stats = self._device.stats
        return self._last_stats

    def _use_parameters(self, parameters: DriverParameters) -> None:
        if self._scanner is None:
            self._device = SonarDevice(parameters, self._stop, clock=rospy.get_time)
            self._scanner = Scanner(self._device, parameters, guarded(self.health, self._publish))
        self._scanner.settings = parameters

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

    def _publish(self, ping: Ping) -> None:
        parameters = self._live.current
        check_stamp(round(ping.stamp * 1e9))
        message = scan_line(
            ping.stamp,
            ping.reply,
            ping.command.start_gain_db,
            parameters.frame_id,
            parameters.inverted,
            self._tilt.for_beam(),
        )
        if message is not None:
            self._beams.publish(message)
            self.health.count("beams out")

    def _end(self) -> None:
        self._stop.set()
        self._thread.join(_LONGEST_STOP)
