"""All beams of a recording, and those of bags."""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, List, Optional

import numpy as np

from node_support.errors import RefusedInput
from recordings.bags.bag import Bag, RecordingError, missing_topic
from recordings.bags.topic_roles import Role, with_role
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.reader import BeamMessageParameters, BeamReader, beam_type
from sonar_processing.scans.assembler import MovingState
from sonar_processing.scans.parameters import SonarToCloudParameters

_VELOCITY_TOPIC = "/cmd_vel"


@dataclass(frozen=True)
class RecordedBeams:
    """beams: in the order of the recording. moving: whether the vehicle moved then. refused: messages without a beam.

    notes: what was assumed, as sentences. soundings: (n, 2) s and m below an echo sounder that was recorded with them.
    gains: of each beam, as its head counts them; empty where they are not known.
    """

    beams: List[Beam]
    moving: List[bool]
    refused: int = 0
    notes: List[str] = field(default_factory=list)
    soundings: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    gains: List[int] = field(default_factory=list)

    @property
    def stamps_ns(self) -> np.ndarray:
        """(n,) int64, ns, in the order of the recording."""
        return np.array([beam.stamp_ns for beam in self.beams], dtype=np.int64)

    def later(self, seconds: float) -> "RecordedBeams":
        """Return the same beams with `seconds` added to their stamps. Raises RefusedInput for a stamp below 0."""
        if seconds == 0.0:
            return self
        shift = round(seconds * 1e9)
        beams = [replace(beam, stamp_ns=beam.stamp_ns + shift) for beam in self.beams]
        return replace(self, beams=beams, soundings=self.soundings + np.array([seconds, 0.0]))


def beam_topic(bag: Bag, wanted: Optional[str]) -> str:
    """Return the topic of the beams: `wanted`, or the likeliest of the bag. Raises RecordingError without one."""
    if wanted is None:
        found = with_role(bag.topics, Role.BEAMS)
        if not found:
            names = ", ".join(sorted(bag.topics)) or "none at all"
            raise RecordingError(f"no topic holds beams of a known type (docs/sonars.md); there are {names}")
        return found[0].name
    if wanted not in bag.topics:
        raise missing_topic(wanted, [bag])
    try:
        beam_type(bag.topics[wanted].type)
    except RefusedInput as error:
        raise RecordingError(f"{wanted}: {error}") from None
    return wanted


def beams_of_bag(bag: Bag, topic: str, parameters: BeamMessageParameters) -> RecordedBeams:
    """Return all beams of a topic, and whether the vehicle moved by its velocity on /cmd_vel."""
    reader, kind = BeamReader(parameters), bag.topics[topic].type
    moving_state, still = MovingState(), SonarToCloudParameters()
    velocities = bag.messages(_VELOCITY_TOPIC)
    velocity = next(velocities, None)
    beams, moving, notes, refused, reason = [], [], bag.notes, 0, ""
    for time, message in list(bag.messages(topic)):
        while velocity is not None and velocity[0] <= time:
            _take_velocity(moving_state, velocity[1])
            velocity = next(velocities, None)
        try:
            reading = reader.read(kind, message)
        except RefusedInput as error:
            refused, reason = refused + 1, reason or str(error)
            continue
        if reading.unit_changed:
            refused += len(beams)
            beams.clear()
            moving.clear()
        beams.extend(reading.beams)
        moving.extend([moving_state.is_moving(still)] * len(reading.beams))
        notes.extend(reading.notes)
        refused += reading.refused
    if reason:
        notes.append(f"{refused} messages of {topic} without a usable beam, the first because of {reason}")
    return RecordedBeams(beams, moving, refused, notes)


def _take_velocity(moving_state: MovingState, message: Any) -> None:
    twist = message if hasattr(message, "linear") else message.twist
    linear, angular = twist.linear, twist.angular
    with suppress(RefusedInput):
        moving_state.take((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))
