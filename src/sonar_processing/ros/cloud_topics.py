"""Topics of clouds, serialised only while somebody reads them, and subscribed to; where the sonar was meanwhile."""

from typing import Callable, Optional

import numpy as np
import rospy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float32

from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.ros.callbacks import guarded
from node_support.ros.transforms import TfBuffer, stamp_of
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
        return self._stamped.get_num_connections() > 0 or self._plain.is_read

    def publish(self, cloud: Cloud) -> None:
        if self._stamped.get_num_connections():
            self._stamped.publish(cloud_to_message(cloud))
        self._plain.publish(cloud)


class PointsPublisher:
    """A cloud's points as PointCloud2, for rviz and for whatever knows nothing of time stamps."""

    def __init__(self, topic: str) -> None:
        self._publisher = rospy.Publisher(topic, PointCloud2, queue_size=QUEUE_SIZE)

    @property
    def is_read(self) -> bool:
        return self._publisher.get_num_connections() > 0

    def publish(self, cloud: Cloud) -> None:
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


_CACHE = 300.0  # s: the slowest head takes minutes for a scan
_PATIENCE = 0.5  # s: transforms come at 2 Hz at least


class SonarPlaces:
    """Remembers tf long enough for a slow scan."""

    def __init__(self, sonar_frame: str, health: Health, stamp_tolerance: float) -> None:
        """`stamp_tolerance`: how far stamps may be from odometry and clock, s."""
        self._frame = sonar_frame
        self.transforms = TfBuffer(health, _CACHE, stamp_tolerance)

    def poses(self, frame_id: str, times: np.ndarray) -> np.ndarray:
        """Return T_frame_sonar (m, 4, 4) in `frame_id` at `times` (m,) [s], NaN where tf does not know it.

        Waits up to half a second for the newest. Raises RefusedInput when tf knows none of them.
        """
        distinct, index = np.unique(times, return_inverse=True)
        stamps = [stamp_of(seconds) for seconds in distinct]
        reason = self.transforms.wait_for(frame_id, self._frame, stamps[-1], _PATIENCE)
        poses = np.array([self._pose(frame_id, stamp) for stamp in stamps])
        if np.isnan(poses).all():
            raise RefusedInput("scans without sonar position", f"{self._frame} in {frame_id}: {reason}")
        return poses[index]

    def at(self, frame_id: str, times: np.ndarray) -> np.ndarray:
        """Return (m, 2) x y [m] of the sonar; see `poses`."""
        return self.poses(frame_id, times)[:, :2, 3]

    def _pose(self, frame_id: str, stamp_ns: int) -> np.ndarray:
        try:
            return self.transforms.matrix(frame_id, self._frame, stamp_ns)
        except RefusedInput:
            return np.full((4, 4), np.nan)
