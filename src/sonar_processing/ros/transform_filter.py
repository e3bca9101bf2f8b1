"""Holds beams back until tf can place them at their own stamps; rospy's tf2 has no MessageFilter."""

import threading
from collections import Counter, deque
from typing import Callable, Deque, List, NamedTuple, Optional

import message_filters
import rospy

from node_support.errors import RefusedInput
from node_support.headers import DAY
from node_support.health import Health
from node_support.ros.node import guarded
from node_support.ros.tf_buffer import JUMP_BACK, TfBuffer
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.ros.sonar_mount import SonarMount

QUEUE_SIZE = 120  # One revolution of the usual head: tf may be late by a scan, not by more
_WAIT = 0.5  # s: beams and transforms wake the thread; this is for shutdown alone


class _WaitingBeam(NamedTuple):
    beam: Beam
    is_moving: bool


class TransformFilter(message_filters.SimpleFilter):
    """Calls back with a PlacedBeam, in the order of the stamps, as soon as tf knows both frames.

    At most `QUEUE_SIZE` beams wait, or what `make_room` was told. A beam is dropped and counted when the queue is full,
    when it is older than one that was delivered, or when tf can place a later beam of its frame but not this one. A
    stamp more than `JUMP_BACK` seconds older than its predecessor means that time jumped: the waiting beams are
    forgotten.
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
        self._most = QUEUE_SIZE
        self._target_frame = target_frame
        self._health = health
        self._on_time_jump = guarded(health, on_time_jump)
        self._condition = threading.Condition()
        self._queue: Deque[_WaitingBeam] = deque()
        self._newest_ns: Optional[int] = None
        self._jumped = False
        self._transforms = TfBuffer(health, tolerance=stamp_tolerance, on_news=self._notify)
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
            if len(self._queue) >= self._most:
                oldest = self._queue.popleft().beam
                self._drop(oldest, self._obstacle(oldest) or f"{self._most} newer beams wait, the machine is too slow")
            self._newest_ns = beam.stamp_ns
            self._queue.append(_WaitingBeam(beam, is_moving))
            self._condition.notify()

    def make_room(self, beams: int) -> None:
        """Let so many beams wait that come at once: those of a whole turn in one message."""
        self._most = max(QUEUE_SIZE, 2 * beams)

    def forget(self) -> None:
        """Forget the waiting beams and the unfinished scan, because they were read wrongly."""
        with self._condition:
            self._queue.clear()
            self._jumped = True
            self._condition.notify()

    def _take_older(self, beam: Beam) -> None:
        seconds = (self._newest_ns - beam.stamp_ns) * 1e-9
        if seconds <= JUMP_BACK:
            raise RefusedInput("beams out of order", f"{seconds:.3f} s older than its predecessor")
        self._queue.clear()
        self._jumped = True
        self._health.problem("jumps back in time", f"by {seconds:.1f} s; the unfinished scan is forgotten")

    def _notify(self) -> None:
        with self._condition:
            self._condition.notify()

    def _work(self) -> None:
        while not rospy.core.is_shutdown_requested():
            self._take()
            with self._condition:
                self._condition.wait(_WAIT)

    def _deliver_ready(self) -> None:
        with self._condition:
            jumped, self._jumped = self._jumped, False
            if self._mount is not None:
                self._mount.look_at(Counter(entry.beam.frame_id for entry in self._queue), self._transforms)
            ready = self._pop_ready()
        if jumped:
            self._on_time_jump()
        for placed in ready:
            self.signalMessage(placed)

    def _pop_ready(self) -> List[PlacedBeam]:
        queued = list(self._queue)
        # From the newest back: what tf brings meanwhile can then only help the older ones.
        placeable = [not self._obstacle(entry.beam) for entry in reversed(queued)][::-1]
        newest = {entry.beam.frame_id: index for index, entry in enumerate(queued) if placeable[index]}
        waits = [index > newest.get(entry.beam.frame_id, -1) for index, entry in enumerate(queued)]
        self._queue = deque(entry for entry, wait in zip(queued, waits) if wait)
        ready = []
        for entry in (entry for entry, wait in zip(queued, waits) if not wait):
            obstacle = self._obstacle(entry.beam)
            if obstacle:
                self._drop(entry.beam, obstacle)
                continue
            try:
                ready.append(self._placed(entry))
            except RefusedInput as refused:
                self._health.problem(refused.kind, str(refused))
        return ready

    def _drop(self, beam: Beam, reason: str) -> None:
        self._health.problem("beams without transform", f"from {beam.frame_id} to {self._target_frame}: {reason}")

    def _obstacle(self, beam: Beam) -> str:
        """Why tf cannot place a beam; empty when it can."""
        return self._transforms.obstacle(self._target_frame, beam.frame_id, beam.stamp_ns)

    def _placed(self, entry: _WaitingBeam) -> PlacedBeam:
        beam = entry.beam
        T_target_sonar = self._transforms.matrix(self._target_frame, beam.frame_id, beam.stamp_ns)
        return PlacedBeam(beam, T_target_sonar, entry.is_moving)
