"""Publishes a stage's result, and serialises it only while somebody reads it."""

import rospy
from sensor_msgs.msg import PointCloud2

from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.conversions import StampedIntensityCloudArrays, cloud_to_message, points_to_message

QUEUE_SIZE = 10


class CloudPublisher:
    """A StampedIntensityCloud on `topic` and the same points as PointCloud2 on `topic`/cloud."""

    def __init__(self, topic: str) -> None:
        self._stamped = rospy.Publisher(topic, StampedIntensityCloudArrays, queue_size=QUEUE_SIZE)
        self._plain = PointsPublisher(f"{topic}/cloud")

    @property
    def is_read(self) -> bool:
        """Whether anybody listens."""
        return self._stamped.get_num_connections() > 0 or self._plain.is_read

    def publish(self, cloud: IntensityCloud) -> None:
        """Send the cloud to those who listen."""
        if self._stamped.get_num_connections():
            self._stamped.publish(cloud_to_message(cloud))
        self._plain.publish(cloud)


class PointsPublisher:
    """A cloud's points as PointCloud2, for rviz and for whatever knows nothing of time stamps."""

    def __init__(self, topic: str) -> None:
        self._publisher = rospy.Publisher(topic, PointCloud2, queue_size=QUEUE_SIZE)

    @property
    def is_read(self) -> bool:
        """Whether anybody listens."""
        return self._publisher.get_num_connections() > 0

    def publish(self, cloud: IntensityCloud) -> None:
        """Send the points to those who listen."""
        if self.is_read:
            self._publisher.publish(points_to_message(cloud))
