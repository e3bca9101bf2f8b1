"""The ROS side of sonar_to_cloud: beams, tf and the velocity in, scans out (thesis 4.5.1, 6.5.2)."""

import math
from typing import Callable, Optional

import numpy as np
import rospy
from geometry_msgs.msg import Twist

from node_support.live_parameters import LiveParameters
from node_support.node import guarded, make_health
from sonar_processing.beam import Beam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.cloud_publisher import CloudPublisher, PointsPublisher
from sonar_processing.conversions import beam_from_message
from sonar_processing.scan_assembler import PlacedBeam, ScanAssembler, SonarToCloudParameters
from sonar_processing.transform_filter import TransformFilter
from underwater_map_construction.msg import SonarScanLine

_BEAM_BUFFER_BYTES = 2**20


class SonarToCloud:
    """Subscribes to beams, publishes scans and hands them to `deliver` where stages share the process."""

    def __init__(self, namespace: str = "~", deliver: Optional[Callable[[IntensityCloud], None]] = None) -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health("sonar_to_cloud")
        self._deliver = deliver
        self._is_moving = False
        self._live = LiveParameters(
            SonarToCloudParameters, namespace, "SonarToCloud", self.health, self._use_parameters
        )
        self._scans = CloudPublisher("sonar/scan/sonarCloud")
        self._laser_scans = PointsPublisher("sonar/scan/laserCloud")
        self._newest_beam = PointsPublisher("sonar/beam")
        self._filter = TransformFilter(self._live.current.target_frame, self.health, self._forget_scan)
        self._filter.registerCallback(guarded(self.health, self._place))
        rospy.Subscriber("cmd_vel", Twist, guarded(self.health, self._take_velocity), queue_size=10)
        rospy.Subscriber(
            "sonar/raw",
            SonarScanLine,
            guarded(self.health, self._take_beam),
            queue_size=200,
            buff_size=_BEAM_BUFFER_BYTES,
            tcp_nodelay=True,
        )

    def _use_parameters(self, parameters: SonarToCloudParameters) -> None:
        self._assembler = ScanAssembler(parameters)

    def _forget_scan(self) -> None:
        self._assembler.clear()

    def _take_velocity(self, twist: Twist) -> None:
        speed = math.hypot(twist.linear.x, twist.linear.y, twist.linear.z)
        turn_rate = math.hypot(twist.angular.x, twist.angular.y, twist.angular.z)
        parameters = self._live.current
        self._is_moving = speed > parameters.still_speed or turn_rate > parameters.still_turn_rate

    def _take_beam(self, message: SonarScanLine) -> None:
        self.health.count("beams in")
        beam = beam_from_message(message)
        self.health.count("points in", beam.intensities.size)
        self._filter.add(beam)

    def _place(self, beam: Beam, T_target_sonar: np.ndarray) -> None:
        placed = PlacedBeam(beam, T_target_sonar, self._is_moving)
        with self.health.timed():
            if self._newest_beam.is_read:
                self._newest_beam.publish(self._assembler.project(placed))
            scan = self._assembler.add(placed)
        self.health.count("beams placed")
        if scan is not None:
            self._publish(scan)

    def _publish(self, scan: IntensityCloud) -> None:
        self.health.count("scans")
        self.health.count("points out", len(scan))
        self._scans.publish(scan)
        if self._live.current.mode.is_laser:
            self._laser_scans.publish(scan)
        if self._deliver is not None:
            self._deliver(scan)
