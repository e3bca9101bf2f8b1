"""Holds beams back until tf can place them at their own stamps; rospy's tf2 has no MessageFilter."""

import threading
from typing import Callable, Optional

import message_filters
import rospy

from node_support.errors import RefusedInput
from node_support.headers import DAY
from node_support.health import Health
from node_support.ros.callbacks import guarded
from node_support.ros.transforms import JUMP_BACK, TfBuffer
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.beam_queue import BeamQueue, Departure
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.ros.sonar_mount import SonarMount

_WAIT = 0.5  # s: beams and transforms wake the thread; this is for shutdown alone
_CACHE = 60.0  # s that tf remembers: the beams that wait, also of a recording played at ten times its speed


class TransformFilter(message_filters.SimpleFilter):
    """Calls back with a PlacedBeam, in the order of the stamps, as soon as tf knows both frames.

    A beam is dropped and counted when it has waited too long (BeamQueue), when it is older than one that was delivered,
    or when tf can place a later beam of its frame but not this one. A stamp more than `JUMP_BACK` seconds older than
    its predecessor means that time jumped: the waiting beams are forgotten.
    """

    def __init__(
        self,
        target_frame: str,
        health: Health,
        on_time_jump: Callable[[], None],
        stamp_tolerance: float = DAY,
        mount: Optional[SonarMount] = None,
    ) -> None:
        """`stamp_tolerance`: how far stamps may be from odometry and clock, s. `mount`: places frames that tf lacks."""
        super().__init__()
        self._mount = mount
        self._target_frame = target_frame
        self._health = health
        self._on_time_jump = guarded(health, on_time_jump)
        self._condition = threading.Condition()
        self._queue = BeamQueue()
        self._newest_ns: Optional[int] = None
        self._jumped = False
        self._has_news = False
        self._transforms = TfBuffer(health, _CACHE, stamp_tolerance, self._notify)
        self._take = guarded(health, self._deliver_ready)
        threading.Thread(target=self._work, daemon=True).start()

    def add(self, beam: Beam, is_moving: bool = False) -> None:
        """Queue a beam and whether the vehicle moved when it came; returns at once.

        Raises RefusedInput for a stamp that is not near odometry or clock, and for a beam out of order.
        """
        self._transforms.check_stamp(beam.stamp_ns)
        with self._condition:
            if self._newest_ns is not None and beam.stamp_ns < self._newest_ns:
                self._take_older(beam)
            self._newest_ns = beam.stamp_ns
            dropped = self._queue.add(beam, is_moving)
            if dropped is not None:
                reason = self._obstacle(dropped.beam) or "many newer beams wait, the machine is too slow"
                self._drop(dropped.beam, reason)
            self._notify()

    def make_room(self, beams: int) -> None:
        """Let so many beams wait that come at once: those of a whole turn in one message."""
        with self._condition:
            self._queue.make_room(beams)

    def forget(self) -> None:
        """Forget the waiting beams and the unfinished scan, because they were read wrongly."""
        with self._condition:
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

    def _notify(self) -> None:
        with self._condition:
            self._has_news = True
            self._condition.notify()

    def _work(self) -> None:
        while not rospy.core.is_shutdown_requested():
            with self._condition:
                self._condition.wait_for(lambda: self._has_news, _WAIT)
                self._has_news = False
            self._take()

    def _deliver_ready(self) -> None:
        with self._condition:
            jumped, self._jumped = self._jumped, False
            if self._mount is not None and self._mount.is_wanted:
                self._mount.look_at(self._queue.frames(), self._transforms)
            placed = [self._placed(departure) for departure in self._queue.pop(self._obstacle)]
        if jumped:
            self._on_time_jump()
        for beam in placed:
            if beam is not None:
                self.signalMessage(beam)

    def _placed(self, departure: Departure) -> Optional[PlacedBeam]:
        """Return the beam with its place, None (counted) where tf does not know it."""
        beam = departure.waiting.beam
        if departure.obstacle:
            self._drop(beam, departure.obstacle)
            return None
        try:
            T_target_sonar = self._transforms.matrix(self._target_frame, beam.frame_id, beam.stamp_ns)
        except RefusedInput as refused:
            self._health.problem(refused.kind, str(refused))
            return None
        return PlacedBeam(beam, T_target_sonar, departure.waiting.is_moving)

    def _drop(self, beam: Beam, reason: str) -> None:
        self._health.problem("beams without transform", f"from {beam.frame_id} to {self._target_frame}: {reason}")

    def _obstacle(self, beam: Beam) -> str:
        """Why tf cannot place a beam; empty when it can."""
        return self._transforms.obstacle(self._target_frame, beam.frame_id, beam.stamp_ns)
