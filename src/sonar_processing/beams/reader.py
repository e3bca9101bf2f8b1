"""Turns messages of any known type into beams."""

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Callable, Dict, List, Optional, Set

from node_support.errors import RefusedInput
from node_support.headers import check_frame, check_stamp
from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.beam_fields import BeamFields
from sonar_processing.beams.beam_types import BEAM_TYPES, OWN, AngleUnit, BeamType, RadiansOrGradians

_REFUSED = "beams refused"


class HeadTurns(Enum):
    TYPE = "TYPE"
    COUNTER_CLOCKWISE = "COUNTER_CLOCKWISE"
    CLOCKWISE = "CLOCKWISE"


@dataclass(frozen=True)
class BeamMessageParameters(ParameterSet):
    angle_unit: AngleUnit = parameter(
        AngleUnit.TYPE,
        "unit of the head's angle; TYPE: as documented for the message type, or gradians where the values show them",
        tunable=False,
    )
    head_turns: HeadTurns = parameter(
        HeadTurns.TYPE,
        "which way the head's angle grows, seen from the tip of +z; TYPE: as documented for the message type",
        tunable=False,
    )
    image_range: float = parameter(
        0.0, "range of a sonar that sends pictures of its turns, which do not tell it, as Stonefish's do; 0: not known",
        unit="m", low=0.0, high=1000.0, tunable=False,
    )  # fmt: skip


@dataclass(frozen=True)
class Reading:
    """What a message held.

    beams: in the order of the message. notes: sentences about its type to be said once. unit_changed: the unit of
    angles turned out to be another, so that beams before it were placed wrongly. refused: rays that make no beam.
    """

    beams: List[Beam]
    notes: List[str] = field(default_factory=list)
    unit_changed: bool = False
    refused: int = 0


class BeamReader:
    """Reads the messages of one topic, which may change their type while it runs."""

    def __init__(self, parameters: BeamMessageParameters) -> None:
        self._parameters = parameters
        self._guesses: Dict[str, RadiansOrGradians] = {}
        self._units: Dict[str, AngleUnit] = {}
        self._described: Set[str] = set()
        self._readers: Dict[str, Callable[[Any], List[BeamFields]]] = {}

    def read(self, type_name: str, message: Any) -> Reading:
        """Return the beams of a message of the type package/Type; raises RefusedInput for one that cannot be used."""
        kind = beam_type(type_name)
        if type_name not in self._readers:
            self._readers[type_name] = kind.reader(self._parameters.image_range)
        found = _fields(self._readers[type_name], type_name, message)
        unit, before = self._unit(kind, found), self._units.get(type_name)
        # Angles that do not tell the unit are 0, which is the same in all of them.
        beams = self._beams(found, kind, unit or kind.unit)
        if unit is None:
            return Reading(beams, refused=len(found) - len(beams))
        self._units[type_name] = unit
        changed = before not in (None, unit)
        return Reading(beams, self._notes(kind, type_name, unit, changed), changed, len(found) - len(beams))

    def _beams(self, found: List[BeamFields], kind: BeamType, unit: AngleUnit) -> List[Beam]:
        """Return those that can be used; raises RefusedInput where none can."""
        beams, problem = [], None
        for one in found:
            try:
                beams.append(self._beam(one, kind, unit))
            except RefusedInput as refused:
                problem = refused
        if problem is not None and not beams:
            raise problem
        return beams

    def _unit(self, kind: BeamType, found: List[BeamFields]) -> Optional[AngleUnit]:
        """Return the unit of the angles, None before they have told it."""
        if self._parameters.angle_unit is not AngleUnit.TYPE:
            return self._parameters.angle_unit
        if not kind.may_be_gradians:
            return kind.unit
        guess = self._guesses.setdefault(kind.names[0], RadiansOrGradians())
        for one in found:
            guess.take(one.angle)
        return guess.unit

    def _beam(self, found: BeamFields, kind: BeamType, unit: AngleUnit) -> Beam:
        check_stamp(found.stamp_ns)
        # Drivers of ROS 1's first years name frames "/sonar"; tf2 knows them without the slash.
        frame_id = found.frame_id.lstrip("/")
        check_frame(frame_id, _REFUSED)
        angle = unit.to_radians(found.angle) - kind.unit.to_radians(kind.ahead)
        beam = Beam(
            stamp_ns=found.stamp_ns,
            frame_id=frame_id,
            angle=-angle if self._is_clockwise(kind) else angle,
            intensities=found.intensities,
            range_resolution=found.range_resolution,
            sensor_angle=found.sensor_angle,
        )
        return replace(beam, stamp_ns=beam.stamp_ns - found.travel_time_ns) if kind.stamped_after_reply else beam

    def _is_clockwise(self, kind: BeamType) -> bool:
        if self._parameters.head_turns is HeadTurns.TYPE:
            return kind.clockwise
        return self._parameters.head_turns is HeadTurns.CLOCKWISE

    def _notes(self, kind: BeamType, type_name: str, unit: AngleUnit, changed: bool) -> List[str]:
        if OWN in kind.names or (type_name in self._described and not changed):
            return []
        self._described.add(type_name)
        is_told = self._parameters.angle_unit is AngleUnit.TYPE and unit is not kind.unit
        told = ", told by their values" if is_told else ""
        way = "clockwise" if self._is_clockwise(kind) else "counter-clockwise"
        text = (
            f"beams of {type_name}: angles in {unit.value.lower()}{told} (angle_unit sets the unit), growing {way} "
            "seen from the tip of +z of their frame (head_turns sets the direction); see docs/sonars.md"
        )
        return [text] + ([f"{type_name}: {kind.advice}"] if kind.advice else [])


def _fields(read: Callable[[Any], List[BeamFields]], type_name: str, message: Any) -> List[BeamFields]:
    try:
        found = read(message)
    except RefusedInput:
        raise
    except (AttributeError, TypeError, ValueError, OverflowError, IndexError, ZeroDivisionError) as error:
        raise RefusedInput(_REFUSED, f"{type_name} not as expected: {error}") from error
    if not found:
        raise RefusedInput(_REFUSED, f"{type_name} without rays")
    return found


def beam_type(type_name: str) -> BeamType:
    """Return what is known of a type by its name in ROS 1 or 2; raises RefusedInput for a type that is not read."""
    # package/msg/Type in ROS 2, package/Type in ROS 1
    kind = BEAM_TYPES.get(type_name.replace("/msg/", "/"))
    if kind is None:
        raise RefusedInput(
            "messages of unknown types", f"{type_name} is not read as beams; known are {', '.join(BEAM_TYPES)}"
        )
    return kind
