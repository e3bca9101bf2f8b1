"""Publishes one number that a stage tells of its newest cloud, so that it can be plotted."""

from typing import Optional

import rospy
from std_msgs.msg import Float32

from node_support.health import Health

QUEUE_SIZE = 10


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
