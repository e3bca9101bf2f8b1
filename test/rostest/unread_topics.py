#!/usr/bin/env python3
"""What nobody reads is not made: no cloud, scan or image is serialised, and no echo is looked for."""

import unittest
from typing import Iterable, List

import rospy
import tf2_ros
from graph import Inbox, publisher, run, wait_until
from messages import transform, turn
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, LaserScan, PointCloud2
from std_msgs.msg import Float32

from node_support.ros.node import publish_diagnostics
from sonar_processing.ros.conversions import LaserScanArrays, StampedIntensityCloudArrays
from sonar_processing.ros.pipeline import Pipeline
from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

BEAMS = 60
TOPICS = {
    "/sonar/scan/sonarCloud": StampedIntensityCloud,
    "/sonar/scan/sonarCloud/cloud": PointCloud2,
    "/sonar/scan/laserCloud": PointCloud2,
    "/sonar/scan/laserScan": LaserScan,
    "/sonar/scan/polar": StampedIntensityCloud,
    "/sonar/scan/polar/cloud": PointCloud2,
    "/sonar/scan/thresholded": StampedIntensityCloud,
    "/sonar/scan/thresholded/cloud": PointCloud2,
    "/sonar/scan/cleaned": StampedIntensityCloud,
    "/sonar/scan/cleaned/cloud": PointCloud2,
    "/sonar/scan/echoes": StampedIntensityCloud,
    "/sonar/scan/echoes/cloud": PointCloud2,
    "/sonar/beam": PointCloud2,
    "/sonar/image": Image,
    "/sonar/camera_info": CameraInfo,
    "/thresholder/threshold": Float32,
    "/echo_extractor/threshold": Float32,
}


def count_serialised(kind: type, counted: List[type]) -> None:
    """Add a message type to a list whenever one of its messages is serialised, whoever asks for it."""
    serialize = kind.serialize

    def call(*arguments: object) -> None:
        counted.append(kind)
        serialize(*arguments)

    kind.serialize = call


class UnreadTopics(unittest.TestCase):
    """The host runs in this process, so that what it does can be counted."""

    @classmethod
    def setUpClass(cls) -> None:
        """Host everything, with the odometry as velocity, and connect."""
        cls.serialised: List[type] = []
        for kind in (StampedIntensityCloudArrays, LaserScanArrays, PointCloud2, Image, CameraInfo, Float32):
            count_serialised(kind, cls.serialised)
        rospy.set_param("sonar_to_cloud", {"velocity_topic": "odom", "velocity_type": "ODOMETRY", "mode": "LASER"})
        cls.host = Pipeline()
        publish_diagnostics(cls.host.healths)
        cls.transforms = tf2_ros.StaticTransformBroadcaster()
        cls.transforms.sendTransform(transform("odom", "sonar"))
        cls.beams, cls.odometry = publisher("/sonar/raw", SonarScanLine), publisher("/odom", Odometry)
        cls.time = rospy.get_time()

    def send_turn(self) -> None:
        """Publish a full turn with an echo in every beam."""
        for step, message in enumerate(turn(self.time, 0.1, BEAMS)):
            message.intensities = bytes([3] * (20 + step % 7) + [120] * 3 + [3] * (27 - step % 7))
            self.beams.publish(message)
        type(self).time += 0.1 * BEAMS

    def comes_by_a_turn(self, inboxes: Iterable[Inbox]) -> bool:
        """Publish a turn, and tell shortly after whether every inbox has a message."""
        self.send_turn()
        return wait_until(lambda: all(inbox.messages for inbox in inboxes), timeout=0.2, required=False)

    def number(self, stage: str, counter: str) -> int:
        """Return a counter of a stage; 0 before its first count."""
        health = next(health for health in self.host.healths if health.name == stage)
        return int(health.report().values.get(counter, 0))

    def test_1_nothing_is_serialised_while_nobody_reads(self) -> None:
        self.send_turn()
        wait_until(lambda: self.number("outlier_remover", "clouds out") == 1)
        wait_until(lambda: self.number("sonar_to_cloud", "turns") == 1)
        self.assertEqual(self.serialised, [])
        self.assertEqual(self.number("echo_extractor", "clouds in"), 0)
        self.assertEqual(self.number("sonar_image", "beams in"), 0)

    def test_2_every_topic_comes_when_it_is_read(self) -> None:
        moving = Odometry()
        moving.twist.twist.linear.x = 0.5
        self.odometry.publish(moving)
        wait_until(lambda: self.number("sonar_to_cloud", "velocities in") == 1)
        inboxes = {topic: Inbox(topic, kind) for topic, kind in TOPICS.items()}
        wait_until(lambda: self.comes_by_a_turn(inboxes.values()))
        received = {topic: inbox.wait_for() for topic, inbox in inboxes.items()}
        moved = inboxes["/sonar/scan/sonarCloud"].wait_for(lambda cloud: min(cloud.timeStamps) > 0.0)
        self.assertGreaterEqual(len(self.serialised), len(TOPICS))
        self.assertEqual(len(moved.timeStamps), moved.cloud.width * moved.cloud.height)
        self.assertEqual(len(received["/sonar/scan/laserScan"].ranges), BEAMS)
        self.assertEqual(received["/sonar/scan/polar"].cloud.height, BEAMS)
        self.assertEqual(received["/sonar/image"].encoding, "mono8")


if __name__ == "__main__":
    run(UnreadTopics)
