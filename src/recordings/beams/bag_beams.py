"""Beams of a bag."""

from contextlib import suppress
from typing import Any, Optional

from node_support.errors import RefusedInput
from recordings.bags.bag import Bag
from recordings.beams.found_beams import FoundBeams
from recordings.errors import RecordingError
from recordings.messages.roles import Role, with_role
from sonar_processing.messages.parameters import BeamMessageParameters
from sonar_processing.messages.reader import BeamReader, beam_type
from sonar_processing.scans.moving_state import MovingState
from sonar_processing.scans.parameters import SonarToCloudParameters

_VELOCITY_TOPIC = "/cmd_vel"


def beam_topic(bag: Bag, wanted: Optional[str]) -> str:
    """Return the topic of the beams: `wanted`, or the likeliest of the bag. Raises RecordingError without one."""
    names = ", ".join(sorted(bag.topics)) or "none at all"
    if wanted is None:
        found = with_role(bag.topics, Role.BEAMS)
        if not found:
            raise RecordingError(f"no topic holds beams of a known type (docs/sonars.md); there are {names}")
        return found[0].name
    if wanted not in bag.topics:
        raise RecordingError(f"no topic {wanted}; there are {names}")
    try:
        beam_type(bag.topics[wanted].type)
    except RefusedInput as error:
        raise RecordingError(f"{wanted}: {error}") from None
    return wanted


def beams_of_bag(bag: Bag, topic: str, parameters: BeamMessageParameters) -> FoundBeams:
    """Return all beams of a topic, and whether the vehicle moved by its velocity on /cmd_vel."""
    reader, kind = BeamReader(parameters), bag.topics[topic].type
    moving_state, still = MovingState(), SonarToCloudParameters()
    velocities = bag.messages(_VELOCITY_TOPIC)
    velocity = next(velocities, None)
    found = FoundBeams([], [])
    refused = 0
    for time, message in list(bag.messages(topic)):
        while velocity is not None and velocity[0] <= time:
            _take_velocity(moving_state, velocity[1])
            velocity = next(velocities, None)
        try:
            reading = reader.read(kind, message)
        except RefusedInput:
            refused += 1
            continue
        if reading.unit_changed:
            refused += len(found.beams)
            found.beams.clear()
            found.moving.clear()
        found.beams.extend(reading.beams)
        found.moving.extend([moving_state.is_moving(still)] * len(reading.beams))
        found.notes.extend(reading.notes)
        refused += reading.refused
    return FoundBeams(found.beams, found.moving, refused, found.notes)


def _take_velocity(moving_state: MovingState, message: Any) -> None:
    twist = message if hasattr(message, "linear") else message.twist
    linear, angular = twist.linear, twist.angular
    with suppress(RefusedInput):
        moving_state.take((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))
