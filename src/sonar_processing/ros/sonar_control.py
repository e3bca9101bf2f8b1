"""The ROS side of sonar_control: joint state and beams in, servo commands out."""

import math
import threading
from typing import Optional

import rospy
from std_msgs.msg import Float64, UInt32

from node_support import topics
from node_support.parameters import ParameterError
from node_support.ros.callbacks import every, make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import JointAngle
from sonar_processing.beams.beam import Beam
from sonar_processing.ros.beam_subscriber import BeamSubscriber
from sonar_processing.scans.tilt_scan import SonarControlParameters, TiltScan
from underwater_map_construction.srv import SetScanMode, SetScanModeRequest, SetScanModeResponse

TICK_PERIOD = 0.1  # s: short against every timeout of sonar_control


class SonarControl:
    """Tells a `TiltScan` what happens and the servo what it decides."""

    def __init__(self) -> None:
        """Raises ParameterError for a bad parameter."""
        self.health = make_health("sonar_control")
        self._lock = threading.RLock()
        self._scan: Optional[TiltScan] = None
        self._commands = rospy.Publisher(topics.SERVO_COMMANDS, Float64, queue_size=1, latch=True)
        self._sweeps = rospy.Publisher("~sweeps", UInt32, queue_size=1, latch=True)
        self._live = ReconfigurableParameters(SonarControlParameters, "~", self.health, self._use_parameters)
        rospy.Service("~set_mode", SetScanMode, self._set_mode)
        self._joint = JointAngle(self._live.current.joint, self.health, self._take_angle)
        BeamSubscriber(self._take_beam, self._live.current, self.health)
        every(TICK_PERIOD, self._tick, self.health)

    def _use_parameters(self, parameters: SonarControlParameters) -> None:
        with self._lock:
            if self._scan is None:
                self._scan = TiltScan(parameters, rospy.get_time(), self._send, self.health)
            else:
                self._scan.restart(parameters, rospy.get_time())

    def _send(self, angle: float) -> None:
        self._commands.publish(Float64(data=angle))
        self.health.count("commands")

    def _take_angle(self, angle: float) -> None:
        with self._lock:
            self._scan.take_joint(rospy.get_time(), angle)

    def _take_beam(self, beam: Beam) -> None:
        with self._lock:
            before = self._scan.sweeps
            self._scan.take_beam(rospy.get_time(), beam.angle)
            if self._scan.sweeps != before:
                self._sweeps.publish(UInt32(data=self._scan.sweeps))

    def _tick(self) -> None:
        with self._lock:
            self._scan.tick(rospy.get_time())
            self.health.show("mode", self._scan.parameters.mode.value)
            self.health.show("state", self._scan.state.value)
            self.health.show("goal [deg]", f"{math.degrees(self._scan.goal):.1f}")
            self.health.show("sweeps", str(self._scan.sweeps))

    def _set_mode(self, request: SetScanModeRequest) -> SetScanModeResponse:
        try:
            self._live.change({"mode": request.mode})
        except ParameterError as error:
            return SetScanModeResponse(False, str(error))
        return SetScanModeResponse(True, f"mode is {request.mode}")
