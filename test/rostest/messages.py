"""Messages that several rostests send, and what they read of poses."""

import math
from typing import Any, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped

from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import cloud_to_message
from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

# Of a beam of 50 bins: a wall among weak echoes.
WALL = bytes([3] * 20 + [120] * 3 + [3] * 27)


def transform(
    parent: str, child: str, seconds: float = 0.0, x: float = 0.0, y: float = 0.0, yaw: float = 0.0
) -> TransformStamped:
    """Return a transform in the plane."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, rospy.Time.from_sec(seconds)
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation.z, message.transform.rotation.w = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
    return message


def beam(seconds: float, angle: float = 0.0, strengths: bytes = WALL, frame: str = "sonar") -> SonarScanLine:
    """Return a beam of 50 m."""
    message = SonarScanLine(intensities=strengths, angle=angle, maxrange_meters=50.0, range_resolution=1.0)
    message.header.frame_id, message.header.stamp = frame, rospy.Time.from_sec(seconds)
    return message


def turn(start: float, period: float, beams: int, frame: str = "sonar") -> List[SonarScanLine]:
    """Return the beams of a head that turns once, which begins at `start` and takes `period` from beam to beam, s."""
    return [beam(start + step * period, 2.0 * math.pi * step / beams, frame=frame) for step in range(beams)]


def still_cloud(points: Sequence, frame: str = "odom", times: Optional[np.ndarray] = None) -> StampedIntensityCloud:
    """Return points (n, 4) that a vehicle that stands still hears now, or at `times` (n,) [s]."""
    times = np.full(len(points), rospy.get_time()) if times is None else times
    end = round(1e9 * times[-1]) if len(times) else rospy.Time.now().to_nsec()
    return cloud_to_message(Cloud(np.asarray(points, dtype=np.float32), -times, end, frame))


def still_echoes(places: np.ndarray, times: np.ndarray) -> StampedIntensityCloud:
    """Return equally strong echoes at places (n, 2) in odom, 2 m deep, as still_cloud does."""
    return still_cloud(np.column_stack([places, np.tile([-2.0, 50.0], (len(places), 1))]), times=times)


def place(message: Any) -> np.ndarray:
    """Return x and y, m, of a message with a pose, with or without a covariance."""
    position = getattr(message.pose, "pose", message.pose).position
    return np.array([position.x, position.y])


def stamps_and_places(messages: Sequence[Any]) -> Tuple[np.ndarray, np.ndarray]:
    """Return stamps (n,) s and positions (n, 2) m of messages with poses."""
    stamps = np.array([message.header.stamp.to_sec() for message in messages])
    return stamps, np.array([place(message) for message in messages])


def true_places(truth: Sequence[Any], messages: Sequence[Any]) -> np.ndarray:
    """Return where the vehicle truly was at the stamps of messages, (n, 2) m."""
    stamps, places = stamps_and_places(truth)
    times = [message.header.stamp.to_sec() for message in messages]
    return np.column_stack([np.interp(times, stamps, places[:, axis]) for axis in (0, 1)])


def variance(message: Any) -> float:
    """Return the variance of a fix's place, m2."""
    return message.pose.covariance[0] + message.pose.covariance[7]
