"""Publishes the scans of whole revolutions of the head, and makes them only while somebody subscribes."""

from typing import List, Optional

import rospy
from sensor_msgs.msg import PointCloud2

from node_support import topics
from node_support.health import Health
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud_sink import CloudSink
from sonar_processing.ros.conversions import LaserScanArrays, laser_scan_message, point_cloud
from sonar_processing.ros.publishers import QUEUE_SIZE, CloudPublisher
from sonar_processing.scans.laser_scan import planar_laser_scan
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan
from sonar_processing.scans.turn_cloud import TURN_FIELDS, turn_cloud


class RevolutionPublisher:
    """The revolution as organised cloud, as LaserScan and as cloud with times; `sink` gets the organised cloud."""

    def __init__(self, health: Health, sink: Optional[CloudSink] = None) -> None:
        self._health = health
        self._sink = sink
        self._clouds = CloudPublisher(topics.POLAR_SCANS)
        self._turns = rospy.Publisher(topics.TURNS, PointCloud2, queue_size=QUEUE_SIZE)
        self._lasers = rospy.Publisher(topics.LASER_SCANS, LaserScanArrays, queue_size=QUEUE_SIZE)

    def publish(self, beams: List[PlacedBeam], parameters: SonarToCloudParameters) -> None:
        """Send a finished revolution to those who want it."""
        self._health.count("turns")
        scan = PolarScan.of(beams)
        if self._lasers.get_num_connections():
            laser = planar_laser_scan(scan, parameters)
            self._lasers.publish(laser_scan_message(laser, scan.stamp_ns, scan.sonar_frame))
        if self._turns.get_num_connections():
            points = turn_cloud(scan, parameters)
            self._turns.publish(point_cloud(points, scan.stamp_ns, scan.sonar_frame, fields=TURN_FIELDS))
        is_taken = self._sink is not None and self._sink.is_wanted()
        if not (is_taken or self._clouds.is_read):
            return
        cloud = scan.cloud(parameters)
        self._clouds.publish(cloud)
        if is_taken:
            self._sink.take(cloud)
