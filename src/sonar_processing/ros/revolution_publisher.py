"""Publishes what is made of a whole turn of the head, and makes it only while somebody wants it."""

from typing import List, Optional, Protocol

import rospy

from node_support import topics
from node_support.health import Health
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.cloud_publisher import QUEUE_SIZE, CloudPublisher
from sonar_processing.ros.conversions import LaserScanArrays, laser_scan_message
from sonar_processing.scans.laser_scan import laser_turn
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan


class CloudTaker(Protocol):
    """Takes clouds within the process, while anybody wants what it makes of them."""

    is_wanted: bool

    def process(self, cloud: IntensityCloud) -> None:
        """Take a cloud."""


class TurnPublisher:
    """The turn as organised cloud and as LaserScan; `taker` gets the cloud within the process."""

    def __init__(self, health: Health, taker: Optional[CloudTaker] = None) -> None:
        self._health = health
        self._taker = taker
        self._clouds = CloudPublisher(topics.POLAR_SCANS)
        self._lasers = rospy.Publisher(topics.LASER_SCANS, LaserScanArrays, queue_size=QUEUE_SIZE)

    def publish(self, beams: List[PlacedBeam], parameters: SonarToCloudParameters) -> None:
        """Send a finished turn to those who want it."""
        self._health.count("turns")
        scan = PolarScan.of(beams)
        if self._lasers.get_num_connections():
            turn = laser_turn(scan, parameters)
            self._lasers.publish(laser_scan_message(turn, scan.stamp_ns, scan.sonar_frame))
        is_taken = self._taker is not None and self._taker.is_wanted
        if not (is_taken or self._clouds.is_read):
            return
        cloud = scan.cloud(parameters)
        self._clouds.publish(cloud)
        if is_taken:
            self._taker.process(cloud)
