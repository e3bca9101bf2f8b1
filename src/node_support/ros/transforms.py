"""Where frames and joints are, as one stage knows them; the only place that talks to tf2."""

import math
import threading
import time
from collections import deque
from functools import partial
from typing import Callable, Deque, Dict, Hashable, Iterator, Optional, Tuple

import genpy
import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, TransformStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from node_support import topics
from node_support.errors import RefusedInput
from node_support.geometry import quaternion_of, rotation_matrices
from node_support.headers import DAY, JUMP_BACK, check_frame, check_stamp
from node_support.health import Health
from node_support.ros.callbacks import guarded

_FEWEST = 5  # changes under one stamp: some publishers correct what they have just said
_MOST_TOLD = 100


class StandingClock:
    """Watches the stamps [ns] of senders whose messages differ.

    stood: from which stamp to which one [s] a clock went on after it had stood: what happened meanwhile looks sudden.
    """

    def __init__(self) -> None:
        self.stood: Deque[Tuple[float, float]] = deque(maxlen=_MOST_TOLD)
        self._newest: Dict[Hashable, Tuple[int, object, int]] = {}

    def take(self, sender: Hashable, stamp_ns: int, said: object) -> bool:
        """Learn a message; return whether it is the one that shows that its clock stands."""
        stamp, before, changes = self._newest.get(sender, (0, said, 0))
        if stamp_ns != stamp:
            if changes >= _FEWEST and stamp_ns > stamp:
                self.stood.append((stamp * 1e-9, stamp_ns * 1e-9))
            changes = 0
        elif said != before:
            changes += 1
        self._newest[sender] = stamp_ns, said, changes
        return stamp_ns == stamp and said != before and changes == _FEWEST

    def stands_at(self, stamp_ns: int) -> bool:
        return any(changes >= _FEWEST and stamp <= stamp_ns for stamp, _, changes in list(self._newest.values()))


_KIND = "transforms refused"
_QUEUE_SIZE = 1000  # some seconds of a busy /tf, while a slow callback holds the others up
_REMEMBERED = 64  # stamps: about a second of /tf, with each of its publishers among them
_MOST_FRAMES = 1000  # tf2 never forgets a frame; no vehicle has as many
_PARENT_CEASED = 5.0  # s of wall time: tf that changes comes more often
_ROUNDING = 1e-6  # s: more than a float64 loses of the seconds since 1970
_SQUARED_NORM_ERROR = 0.01  # tf2 refuses quaternions that are farther from a unit, and tells of each on stderr


class TfBuffer:
    """Remembers transforms, answers at stamps and waits for transforms to come.

    Transforms that tf2 cannot take are refused and counted. When the stamps of a frame go back by more than
    `JUMP_BACK`, as when a bag loops, all transforms that change are forgotten. A clock that stands while a frame moves
    is counted, see `clock`.
    """

    def __init__(
        self, health: Health, cache: float = 10.0, tolerance: float = DAY, on_news: Callable[[], None] = lambda: None,
        parent: str = "",
    ) -> None:  # fmt: skip
        """`cache`: how long transforms are remembered, s. `tolerance`: stamp_tolerance, s. `on_news`: called with each
        message of tf. `parent`: which of two parents of a frame is taken; of others the one that came first.
        """
        self._health = health
        self._tolerance = tolerance
        self._on_news = on_news
        self._buffer = tf2_ros.BufferCore(genpy.Duration.from_sec(cache))
        self._condition = threading.Condition()
        self._recent_ns: Deque[int] = deque(maxlen=_REMEMBERED)
        self._newest_ns: Dict[str, int] = {}
        self._parent = parent
        self._parents: Dict[str, Tuple[str, float]] = {}
        self.clock = StandingClock()
        for topic, add in ((topics.TRANSFORMS, self._add), (topics.STATIC_TRANSFORMS, self._add_static)):
            rospy.Subscriber(topic, TFMessage, guarded(health, partial(self._take, add)), queue_size=_QUEUE_SIZE)

    def check_stamp(self, stamp_ns: int) -> None:
        """Raise RefusedInput for a stamp [ns] that is not near the newest odometry or the clock."""
        check_stamp(stamp_ns, self._references_ns(), self._tolerance)

    def knows(self, frame: str) -> bool:
        """Return whether any transform from or to a frame has come."""
        return bool(self._buffer._frameExists(frame))

    def obstacle(self, target: str, source: str, stamp_ns: int) -> str:
        """Return why `source` cannot be placed in `target` at a stamp [ns]; empty when it can."""
        check_stamp(stamp_ns)
        can, reason = self._buffer.can_transform_core(target, source, _time(stamp_ns))
        return "" if can else reason or "unknown to tf"

    def matrix(self, target: str, source: str, stamp_ns: int) -> np.ndarray:
        """Return (4, 4) T_target_source at a stamp [ns]; raises RefusedInput when tf does not know it."""
        check_stamp(stamp_ns)
        return self._looked_up(target, source, _time(stamp_ns))[1]

    def newest(self, target: str, source: str) -> Optional[Tuple[int, np.ndarray]]:
        """Return the newest stamp [ns] and (4, 4) T_target_source; None when tf knows none.

        The stamp is 0 where nothing between the frames changes.
        """
        try:
            return self._looked_up(target, source, genpy.Time(0))
        except RefusedInput:
            return None

    def wait_for(self, target: str, source: str, stamp_ns: int, patience: float) -> str:
        """Wait up to `patience` seconds of wall time until tf knows a transform; return what is in the way, or ""."""
        deadline = time.monotonic() + patience
        with self._condition:
            while True:
                obstacle = self.obstacle(target, source, stamp_ns)
                left = deadline - time.monotonic()
                if not obstacle or left <= 0.0 or rospy.core.is_shutdown_requested():
                    return obstacle
                self._condition.wait(left)

    def clear(self) -> None:
        with self._condition:
            self._buffer.clear()
            self._newest_ns.clear()

    def _looked_up(self, target: str, source: str, stamp: genpy.Time) -> Tuple[int, np.ndarray]:
        try:
            found = self._buffer.lookup_transform_core(target, source, stamp)
        except tf2_ros.TransformException as error:
            raise RefusedInput("transforms missing", f"from {source} to {target}: {error}") from error
        return found.header.stamp.to_nsec(), matrix_from_message(found.transform)

    def _references_ns(self) -> Iterator[int]:
        yield from list(self._recent_ns)
        clock = rospy.get_rostime().to_nsec()
        if clock:
            yield clock

    def _take(self, add: Callable[[TransformStamped, str], None], message: TFMessage) -> None:
        publisher = message._connection_header.get("callerid", "unknown")
        with self._condition:
            for transform in message.transforms:
                try:
                    add(transform, publisher)
                except RefusedInput as refused:
                    self._health.problem(refused.kind, f"{publisher}: {refused}")
            self._condition.notify_all()
        self._on_news()

    def _add(self, transform: TransformStamped, publisher: str) -> None:
        stamp_ns, child = transform.header.stamp.to_nsec(), transform.child_frame_id
        check_stamp(stamp_ns)
        references = list(self._references_ns()) if self._recent_ns else ()
        self._recent_ns.append(stamp_ns)
        check_stamp(stamp_ns, references, self._tolerance)
        self._check(transform)
        if stamp_ns < self._newest_ns.get(child, 0) - JUMP_BACK * 1e9:
            self.clear()
        if self.clock.take((child, publisher), stamp_ns, transform.transform):
            detail = f"{child!r} moves, and stays at {stamp_ns * 1e-9:.3f} s; check the clock of {publisher}"
            self._health.problem("clocks that stood while the vehicle moved", detail)
        if stamp_ns == self._newest_ns.get(child):
            return  # tf2 would leave it out, too, and write a line for each
        self._buffer.set_transform(transform, publisher)
        self._newest_ns[child] = max(stamp_ns, self._newest_ns.get(child, 0))

    def _add_static(self, transform: TransformStamped, publisher: str) -> None:
        self._check(transform)
        # tf2 does not use the stamp, but reads it.
        transform.header.stamp = genpy.Time(0)
        self._buffer.set_transform_static(transform, publisher)
        self._newest_ns.setdefault(transform.child_frame_id, 0)

    def _check(self, transform: TransformStamped) -> None:
        parent, child = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
        for frame in (parent, child):
            check_frame(frame, _KIND)
        if parent == child:
            raise RefusedInput(_KIND, f"{child!r} in itself")
        if child not in self._newest_ns and len(self._newest_ns) >= _MOST_FRAMES:
            raise RefusedInput(_KIND, f"{child!r} after {_MOST_FRAMES} other frames; check who publishes so many")
        shift, turn = transform.transform.translation, transform.transform.rotation
        squared_norm = turn.x * turn.x + turn.y * turn.y + turn.z * turn.z + turn.w * turn.w
        if not (math.isfinite(shift.x + shift.y + shift.z) and abs(squared_norm - 1.0) < _SQUARED_NORM_ERROR):
            shown = f"translation {shift.x} {shift.y} {shift.z}, quaternion {turn.x} {turn.y} {turn.z} {turn.w}"
            raise RefusedInput(_KIND, f"{shown}, must be finite and of length 1")
        self._check_parent(child, parent)

    def _check_parent(self, child: str, parent: str) -> None:
        """Refuse a second parent of a frame, between which tf could not interpolate; one that ceased is replaced."""
        known, heard = self._parents.get(child, (parent, 0.0))
        if known != parent:
            if known == self._parent or (parent != self._parent and time.monotonic() - heard < _PARENT_CEASED):
                detail = f"{child!r} in {parent!r} too, besides {known!r}, which is taken; end one of the publishers"
                raise RefusedInput("transforms of a second parent", detail)
            self.clear()
        self._parents[child] = parent, time.monotonic()


class JointAngle:
    """Remembers the newest angle of a joint, and calls back with it."""

    def __init__(self, joint: str, health: Health, on_angle: Callable[[float], None] = lambda angle: None) -> None:
        """`joint`: its name in /joint_states; empty where there is none. `on_angle` takes every angle, rad."""
        self._joint = joint
        self._health = health
        self._on_angle = on_angle
        self._angle: Optional[float] = None
        if joint:
            rospy.Subscriber(topics.JOINT_STATES, JointState, guarded(health, self._take), queue_size=10)

    def for_beam(self) -> float:
        """Return the angle that a beam carries, rad: 0 without a joint, or, which is counted, before it was heard."""
        if self._joint and self._angle is None:
            detail = f"joint {self._joint!r} is not in /{topics.JOINT_STATES}, sensorAngle is 0"
            self._health.problem("beams of unknown tilt", f"{detail}; check sensor_joint and the servo's driver")
        return self._angle or 0.0

    def _take(self, joints: JointState) -> None:
        angle = dict(zip(joints.name, joints.position)).get(self._joint)
        if angle is None:
            return
        if not math.isfinite(angle):
            raise RefusedInput("joint states refused", f"{self._joint} at {angle} rad, must be finite")
        self._angle = angle
        self._on_angle(angle)


def matrix_from_message(transform: Transform) -> np.ndarray:
    """Return the (4, 4) matrix of a transform; raises RefusedInput when it is not finite or no rotation."""
    rotation, shift = transform.rotation, transform.translation
    translation = np.array([shift.x, shift.y, shift.z])
    if not np.isfinite(translation).all():
        raise RefusedInput(_KIND, f"translation {translation}, must be finite")
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_from_message(rotation, _KIND)
    matrix[:3, 3] = translation
    return matrix


def rotation_from_message(rotation: Quaternion, kind: str) -> np.ndarray:
    """Return the (3, 3) matrix of a rotation; raises RefusedInput, as `kind`, when it is none."""
    quaternion = np.array([rotation.x, rotation.y, rotation.z, rotation.w])
    norm = np.linalg.norm(quaternion)
    if not 0.5 < norm < 2.0:
        raise RefusedInput(kind, f"quaternion {quaternion}, must be of length 1")
    return rotation_matrices((quaternion / norm)[np.newaxis])[0]


def pose_from_matrix(matrix: np.ndarray) -> Pose:
    """Return the pose message of a (4, 4) matrix."""
    return Pose(Point(*matrix[:3, 3]), Quaternion(*quaternion_of(matrix)))


def header(stamp_ns: int, frame_id: str) -> Header:
    return Header(stamp=_time(int(stamp_ns)), frame_id=frame_id)


def stamp_of(time: float) -> int:
    """Return the stamp [ns] at which to ask for a time [s].

    Seconds in a float are rounded; a microsecond earlier, tf's newest pose can be asked for at its own time.
    """
    return max(round((time - _ROUNDING) * 1e9), 1)


def _time(stamp_ns: int) -> genpy.Time:
    return genpy.Time(*divmod(stamp_ns, 10**9))
