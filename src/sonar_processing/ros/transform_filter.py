"""Holds beams back until tf can place them at their own stamps; rospy's tf2 has no MessageFilter.

Where nobody tells tf where the sonar is mounted, that is published too.
"""

import threading
import time
from typing import Callable, Dict, List, Optional, Tuple

import rospy
import tf2_ros
from geometry_msgs.msg import Transform, TransformStamped
from std_msgs.msg import Header

from node_support.errors import RefusedInput
from node_support.headers import JUMP_BACK
from node_support.health import Health
from node_support.ros.callbacks import guarded, on_change
from node_support.ros.transforms import TfBuffer, pose_from_matrix
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.beams.beam_queue import BeamQueue, WaitingBeam
from sonar_processing.beams.parameters import SonarPoseParameters

_PATIENCE = 0.5  # s: whoever knows the frame and has started sends it at once, because /tf_static is latched
_FEWEST = 10  # Beams of one frame that wait: a few may be broken messages
_CACHE = 180.0  # s that tf remembers: longer than the beams that wait, also while a busy machine takes none of them


class SonarMount:
    """Fixes the frame of the beams to the vehicle as the parameters say; once, and only a frame that tf lacks."""

    def __init__(self, parameters: SonarPoseParameters, name: str) -> None:
        """`name`: of the node, for its log."""
        self._parameters = parameters
        self._name = name
        self._missing_since: Dict[str, float] = {}
        self._broadcaster: Optional[tf2_ros.StaticTransformBroadcaster] = None

    @property
    def is_wanted(self) -> bool:
        """Whether a frame may still have to be mounted."""
        return bool(self._parameters.mounted_in) and self._broadcaster is None

    def look_at(self, waiting: Dict[str, int], transforms: TfBuffer) -> None:
        """Mount a frame of which many beams have been waiting for a while. waiting: beams by frame."""
        now = time.monotonic()
        for frame, beams in waiting.items():
            if beams < _FEWEST or transforms.knows(frame):
                self._missing_since.pop(frame, None)
            elif now - self._missing_since.setdefault(frame, now) >= _PATIENCE:
                self._mount(frame)
                break

    def _mount(self, frame: str) -> None:
        one = self._parameters
        pose = pose_from_matrix(one.matrix())
        transform = Transform(pose.position, pose.orientation)
        self._broadcaster = tf2_ros.StaticTransformBroadcaster()
        self._broadcaster.sendTransform(TransformStamped(Header(frame_id=one.mounted_in), frame, transform))
        rospy.logwarn(
            "%s: tf does not know %s: it is mounted in %s at %g %g %g m, yaw %g rad%s, as mount_* say",
            self._name, frame, one.mounted_in, one.mount_x, one.mount_y, one.mount_z, one.mount_yaw,
            ", upside down" if one.upside_down else "",
        )  # fmt: skip


class TransformFilter:
    """Calls back with a PlacedBeam, in the order of the stamps, as soon as tf knows both frames.

    A beam is dropped and counted when it has waited too long (BeamQueue), when it is older than one that was delivered,
    or when tf can place a later beam of its frame but not this one. Beams from before tf told anything, which all hear
    that start beside a running head, are counted without a warning. A stamp more than `JUMP_BACK` seconds older than
    its predecessor means that time jumped: the waiting beams are forgotten.
    """

    def __init__(
        self,
        target_frame: str,
        health: Health,
        on_beam: Callable[[PlacedBeam], None],
        on_time_jump: Callable[[], None],
        stamp_tolerance: float,
        mount: Optional[SonarMount] = None,
    ) -> None:
        """`stamp_tolerance`: how far stamps may be from odometry and clock, s. `mount`: places frames that tf lacks."""
        self._mount = mount
        self._target_frame = target_frame
        self._health = health
        self._on_beam, self._on_time_jump = guarded(health, on_beam), guarded(health, on_time_jump)
        self._lock = threading.Lock()
        self._queue = BeamQueue()
        self._newest_ns: Optional[int] = None
        self._jumped = False
        self._has_placed = False
        with self._lock:  # No delivery may look for tf before it is there
            self._notify = on_change(0.0, self._deliver_ready, health)
            self._transforms = TfBuffer(health, _CACHE, stamp_tolerance, self._notify, target_frame)

    def add(self, beam: Beam, is_moving: bool = False) -> None:
        """Queue a beam and whether the vehicle moved when it came; returns at once.

        Raises RefusedInput for a stamp that is not near odometry or clock or stays while the vehicle moves, and for a
        beam out of order.
        """
        self._transforms.check_stamp(beam.stamp_ns)
        with self._lock:
            if self._newest_ns is not None and beam.stamp_ns < self._newest_ns:
                self._take_older(beam)
            if beam.stamp_ns == self._newest_ns and self._transforms.clock.stands_at(beam.stamp_ns):
                detail = f"at {beam.stamp_ns * 1e-9:.3f} s, nobody knows where the sonar was; check the clocks"
                raise RefusedInput("beams of a clock that stands", detail)
            self._newest_ns = beam.stamp_ns
            dropped = self._queue.add(beam, is_moving)
            if dropped is not None:
                reason = self._obstacle(dropped.beam) or "many newer beams wait, the machine is too slow"
                self._drop(dropped.beam, reason)
        self._notify()

    def make_room(self, beams: int) -> None:
        """Let so many beams wait that come at once: those of a whole turn in one message."""
        with self._lock:
            self._queue.make_room(beams)

    def forget(self) -> None:
        """Forget the waiting beams and the unfinished scan, because they were read wrongly."""
        with self._lock:
            self._queue.clear()
            self._jumped = True
        self._notify()

    def _take_older(self, beam: Beam) -> None:
        seconds = (self._newest_ns - beam.stamp_ns) * 1e-9
        if seconds <= JUMP_BACK:
            raise RefusedInput("beams out of order", f"{seconds:.3f} s older than its predecessor")
        self._queue.clear()
        self._jumped = True
        self._health.problem("jumps back in time", f"by {seconds:.1f} s; the unfinished scan is forgotten")

    def _deliver_ready(self) -> None:
        with self._lock:
            jumped, self._jumped = self._jumped, False
            if self._mount is not None and self._mount.is_wanted:
                self._mount.look_at(self._queue.frames(), self._transforms)
            placed = [self._placed(*departure) for departure in self._departures()]
        if jumped:
            self._on_time_jump()
        for beam in placed:
            if beam is not None:
                self._on_beam(beam)

    def _departures(self) -> List[Tuple[WaitingBeam, str]]:
        """Return the beams that leave the queue, each with why it cannot be placed, from the first placed one on."""
        departures = self._queue.pop(self._obstacle)
        placeable = [departure for departure in departures if not departure[1]]
        if self._has_placed or not placeable:
            return departures
        self._has_placed = True
        self._health.count("beams before tf", len(departures) - len(placeable))
        return placeable

    def _placed(self, waiting: WaitingBeam, obstacle: str) -> Optional[PlacedBeam]:
        """Return the beam with its place, None (counted) where tf does not know it."""
        beam = waiting.beam
        if obstacle:
            self._drop(beam, obstacle)
            return None
        try:
            T_target_sonar = self._transforms.matrix(self._target_frame, beam.frame_id, beam.stamp_ns)
        except RefusedInput as refused:
            self._health.problem(refused.kind, str(refused))
            return None
        return PlacedBeam(beam, T_target_sonar, waiting.is_moving)

    def _drop(self, beam: Beam, reason: str) -> None:
        self._health.problem("beams without transform", f"from {beam.frame_id} to {self._target_frame}: {reason}")

    def _obstacle(self, beam: Beam) -> str:
        return self._transforms.obstacle(self._target_frame, beam.frame_id, beam.stamp_ns)
