"""Reads what map_bag needs from a bag, without a master."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, List, Optional, Tuple

import numpy as np
import rosbag
import rospy
import tf2_py
from geometry_msgs.msg import Transform, Twist
from tf2_msgs.msg import TFMessage

from mlsm_manager.matching.problem.scan import Track
from mlsm_manager.offline.recording import Recording, RecordingError, Truth
from node_support.errors import RefusedInput
from node_support.ros.conversions import matrix_from_message
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.messages.parameters import BeamMessageParameters
from sonar_processing.messages.reader import BeamReader
from sonar_processing.scans.moving_state import MovingState
from sonar_processing.scans.parameters import SonarToCloudParameters

# s: longer than any recording; tf must not forget its beginning.
_FOR_EVER = 1_000_000_000
_TF_TOPICS = ("/tf", "/tf_static")
_VELOCITY_TOPIC = "/cmd_vel"


@dataclass(frozen=True)
class BagNames:
    """What is called how in a bag.

    truth: topic of the true pose (Odometry or PoseStamped), or None. z_is_down: odometry and truth count x north, y
    east, z down; they are turned into x, y left, z up (REP-103).
    """

    beams: str
    odom_frame: str
    base_frame: str
    truth: Optional[str]
    z_is_down: bool = False


def read_recording(path: Path, names: BagNames) -> Recording:
    """Return the recording of a bag; raises RecordingError for one that cannot be used."""
    try:
        with rosbag.Bag(str(path)) as bag:
            return _read(bag, path, names)
    except rosbag.ROSBagUnindexedException:
        raise RecordingError(f"{path}: not indexed, the recording was cut off; run: rosbag reindex {path}") from None
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    except (rosbag.ROSBagException, EOFError, ValueError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{path}: no bag, or a broken one: {error}") from None


def _read(bag: rosbag.Bag, path: Path, names: BagNames) -> Recording:
    topics = bag.get_type_and_topic_info().topics
    for topic in [names.beams, *([names.truth] if names.truth else [])]:
        if topic not in topics:
            raise RecordingError(f"{path}: no topic {topic}; there are {', '.join(sorted(topics)) or 'none at all'}")
    if not any(topic in topics for topic in _TF_TOPICS):
        raise RecordingError(
            f"{path}: no /tf, so nothing tells where the beams were taken; there are {', '.join(topics)}"
        )
    buffer, stamps = _transforms(bag, names)
    if not stamps.size:
        stamps = _beam_stamps(bag, names.beams)
    track = _track(buffer, stamps, path, names)
    beams, unplaced = _beams(bag, buffer, path, names)
    return Recording(beams, unplaced, track, _truth(bag, names, path) if names.truth else None)


def _messages(bag: rosbag.Bag, topic: str) -> List[Tuple[float, Any]]:
    # One topic at a time: rosbag keeps one decompressed chunk, and topics often lie in chunks of their own.
    return [(time.to_sec(), message) for _, message, time in bag.read_messages(topics=[topic])]


def _transforms(bag: rosbag.Bag, names: BagNames) -> Tuple[tf2_py.BufferCore, np.ndarray]:
    buffer, stamps = tf2_py.BufferCore(rospy.Duration(_FOR_EVER)), set()
    for topic in _TF_TOPICS:
        for _, raw, _ in bag.read_messages(topics=[topic], raw=True):
            for transform in TFMessage().deserialize(raw[1]).transforms:
                frames = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
                if names.z_is_down and frames == (names.odom_frame, names.base_frame):
                    _turn_up(transform.transform)
                if topic == "/tf_static":
                    buffer.set_transform_static(transform, "map_bag")
                else:
                    buffer.set_transform(transform, "map_bag")
                    stamps.add(transform.header.stamp.to_nsec())
    return buffer, np.array(sorted(stamps), dtype=np.int64)


def _turn_up(transform: Transform) -> None:
    """Turn north-east-down into x, y left, z up: both frames by half a turn about x."""
    transform.translation.y, transform.translation.z = -transform.translation.y, -transform.translation.z
    transform.rotation.y, transform.rotation.z = -transform.rotation.y, -transform.rotation.z


def _beam_stamps(bag: rosbag.Bag, topic: str) -> np.ndarray:
    """Return when the beams were taken, ns: a vehicle that never moves may have static transforms only."""
    stamps = {message.header.stamp.to_nsec() for _, message in _messages(bag, topic)}
    return np.array(sorted(stamps), dtype=np.int64)


def _track(buffer: tf2_py.BufferCore, stamps: np.ndarray, path: Path, names: BagNames) -> Track:
    times, poses, reason = [], [], "no stamps"
    for stamp in stamps:
        matrix, reason = _matrix(buffer, names.odom_frame, names.base_frame, int(stamp))
        if matrix is not None:
            times.append(stamp * 1e-9)
            poses.append([matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])
    if len(times) < 2:
        raise RecordingError(f"{path}: no odometry, tf from {names.base_frame} to {names.odom_frame}: {reason}")
    return Track(np.array(times), np.array(poses))


def _beams(bag: rosbag.Bag, buffer: tf2_py.BufferCore, path: Path, names: BagNames) -> Tuple[List[PlacedBeam], int]:
    moving_state, parameters = MovingState(), SonarToCloudParameters()
    velocities = iter(_messages(bag, _VELOCITY_TOPIC))
    velocity = next(velocities, None)
    reader = BeamReader(BeamMessageParameters())
    placed, unplaced, reason = [], 0, ""
    for time, message in _messages(bag, names.beams):
        while velocity is not None and velocity[0] <= time:
            _take_velocity(moving_state, velocity[1])
            velocity = next(velocities, None)
        beams = _beams_of(reader, message)
        unplaced += not beams
        for beam in beams:
            matrix, reason = _matrix(buffer, names.odom_frame, beam.frame_id, beam.stamp_ns)
            if matrix is None:
                unplaced += 1
            else:
                placed.append(PlacedBeam(beam, matrix, moving_state.is_moving(parameters)))
    if not placed:
        raise RecordingError(f"{path}: none of {unplaced} beams could be placed in {names.odom_frame}: {reason}")
    return sorted(placed, key=lambda one: one.beam.stamp_ns), unplaced


def _beams_of(reader: BeamReader, message: Any) -> List[Beam]:
    try:
        return reader.read(message._type, message).beams
    except RefusedInput:
        return []


def _take_velocity(moving_state: MovingState, message: Any) -> None:
    twist = message if isinstance(message, Twist) or hasattr(message, "linear") else message.twist
    linear, angular = twist.linear, twist.angular
    with suppress(RefusedInput):
        moving_state.take((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))


def _matrix(buffer: tf2_py.BufferCore, target: str, source: str, stamp_ns: int) -> Tuple[Optional[np.ndarray], str]:
    try:
        found = buffer.lookup_transform_core(target, source, rospy.Time(*divmod(stamp_ns, 10**9)))
        return matrix_from_message(found.transform), ""
    except (tf2_py.TransformException, RefusedInput) as error:
        return None, str(error)


def _truth(bag: rosbag.Bag, names: BagNames, path: Path) -> Truth:
    left = -1.0 if names.z_is_down else 1.0
    times, positions = [], []
    for _, message in _messages(bag, names.truth):
        pose = getattr(message, "pose", None)
        pose = getattr(pose, "pose", pose)
        if pose is None or not hasattr(pose, "position"):
            raise RecordingError(f"{path}: {names.truth} holds {message._type}, must be Odometry or PoseStamped")
        times.append(message.header.stamp.to_sec())
        positions.append([pose.position.x, left * pose.position.y])
    kept = np.concatenate([[True], np.diff(times) > 0.0])
    return Truth(np.array(times)[kept], np.array(positions)[kept])
