"""Topics of clouds: published, and serialised, only while somebody reads them; and subscribed to."""

from typing import Callable, Optional

import rospy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float32

from node_support.health import Health
from node_support.ros.callbacks import guarded
from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import (
    StampedIntensityCloudArrays,
    cloud_from_message,
    cloud_to_message,
    points_to_message,
)

QUEUE_SIZE = 10  # a reader that is ten scans late should not get them all
_CLOUD_BUFFER_BYTES = 2**24  # a cloud of a million points; rospy reads one that is larger in pieces, slowly


class CloudPublisher:
    """A StampedIntensityCloud on `topic` and the same points as PointCloud2 on `topic`/cloud."""

    def __init__(self, topic: str) -> None:
        self._stamped = rospy.Publisher(topic, StampedIntensityCloudArrays, queue_size=QUEUE_SIZE)
        self._plain = PointsPublisher(f"{topic}/cloud")

    @property
    def is_read(self) -> bool:
        """Whether anybody listens."""
        return self._stamped.get_num_connections() > 0 or self._plain.is_read

    def publish(self, cloud: Cloud) -> None:
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

    def publish(self, cloud: Cloud) -> None:
        """Send the points to those who listen."""
        if self.is_read:
            self._publisher.publish(points_to_message(cloud))


class FigurePublisher:
    """A Float32 on ~name, and the same number in /diagnostics."""

    def __init__(self, name: str, namespace: str, health: Health) -> None:
        """`namespace` is "~" or the stage's resolved name."""
        self.name = name
        self._health = health
        prefix = namespace if namespace == "~" else f"{namespace}/"
        self._publisher = rospy.Publisher(f"{prefix}{name}", Float32, queue_size=QUEUE_SIZE)

    @property
    def is_read(self) -> bool:
        """Whether anybody listens."""
        return self._publisher.get_num_connections() > 0

    def publish(self, value: Optional[float]) -> None:
        """Send the number to those who listen; None is not sent."""
        if value is None:
            return
        self._health.show(self.name, f"{value:.2f}")
        if self.is_read:
            self._publisher.publish(Float32(data=value))


def subscribe_to_clouds(topic: str, take: Callable[[Cloud], None], health: Health) -> rospy.Subscriber:
    """Call back with every StampedIntensityCloud on `topic` that can be used; others are counted in `health`."""
    return rospy.Subscriber(
        topic,
        StampedIntensityCloudArrays,
        guarded(health, lambda message: take(cloud_from_message(message)), topic),
        queue_size=QUEUE_SIZE,
        buff_size=_CLOUD_BUFFER_BYTES,
        tcp_nodelay=True,
    )


def report_broken(cloud: Cloud, health: Health) -> None:
    """Count the points of a cloud that are not finite although no stage removed them."""
    if cloud.broken:
        detail = f"{cloud.broken} of {len(cloud)} in a cloud; check the publisher"
        health.problem("points that are not finite", detail, cloud.broken)
