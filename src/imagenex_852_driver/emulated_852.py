"""An Imagenex 852 in software: a state machine from commands to replies with the delays of sound and line."""

from dataclasses import dataclass
from typing import List, Optional

from imagenex_852_driver.command import CommandReader, SwitchCommand
from imagenex_852_driver.parameters import ping_leaves, reply_begins
from imagenex_852_driver.reply import (
    AHEAD,
    HEAD_IDS,
    HEADER_LENGTH,
    OVERRUN,
    SONAR_HEAD_ID,
    SWITCHES_ACCEPTED,
    Reply,
    head_angle,
)
from node_support.parameters import parameter, with_defaults
from sonar_driver.emulated_head import (
    EchoSource,
    EmulatedHead,
    EmulatedHeadParameters,
    Fault,
    FaultInjector,
    PingRequest,
    Transmission,
)

_TURN = 2400  # Head positions in a full turn, 0.15 deg each (manufacturer's specification)
_SONAR_STATUS = 0x01  # Status of a head that is a sonar, not a profiler (manufacturer's specification)
_FULL_STRENGTH_DB = 20  # Start gain at which an echo has its usual strength


@dataclass(frozen=True)
@with_defaults(link="/tmp/imagenex_852")
class EmulatorParameters(EmulatedHeadParameters):
    """Parameters of imagenex_852_emulator."""

    overrun: float = parameter(0.0, "share of replies that report a character overrun", low=0.0, high=1.0)
    head_id: int = parameter(SONAR_HEAD_ID, "number of the head", low=HEAD_IDS[0], high=HEAD_IDS[-1], tunable=False)


class HeadRotation:
    """The transducer's position, in the head's units (0.15 deg, clockwise, 1400 ahead).

    In a sector the head goes back and forth; with 360 deg it turns without end. A change of the command's
    reverse bit reverses it. A head that is outside the sector steps towards it.
    """

    def __init__(self) -> None:
        self.position = AHEAD
        self.clockwise = True
        self._reverse = False

    def obey(self, command: SwitchCommand) -> None:
        """Adopt the direction of a command, before the ping."""
        if command.reverse != self._reverse:
            self._reverse = command.reverse
            self.clockwise = not self.clockwise

    def step(self, command: SwitchCommand) -> None:
        width, size = _positions(command.sector_width_deg), _positions(command.step_size_deg)
        low = AHEAD + _positions(command.train_angle_deg) - width // 2
        high = low + width
        if not size:
            return
        if not low <= self.position <= high:
            self.clockwise = self.position < low
            goal = low if self.clockwise else high
        elif width == _TURN:
            self.position = low + (self.position - low + (size if self.clockwise else -size)) % _TURN
            return
        else:
            if self.position == (high if self.clockwise else low):
                self.clockwise = not self.clockwise
            goal = high if self.clockwise else low
        distance = min(size, abs(goal - self.position))
        self.position += distance if self.clockwise else -distance


def _positions(degrees: int) -> int:
    return degrees * 20 // 3


class Emulated852(EmulatedHead):
    """An Imagenex 852 in software.

    It answers only commands that carry its identification, with the commanded range, number of points, gain and
    delay, and turns as commanded.
    """

    def __init__(
        self,
        parameters: Optional[EmulatorParameters] = None,
        echo_source: Optional[EchoSource] = None,
        faults: Optional[FaultInjector] = None,
    ) -> None:
        super().__init__(parameters or EmulatorParameters(), echo_source, faults)
        self.reboot()

    def reboot(self) -> None:
        """Discard an unfinished command, the position and the direction, as after a loss of power."""
        self._reader = CommandReader()
        self._motion = HeadRotation()

    def receive(self, data: bytes, time: float) -> List[Transmission]:
        answers = []
        for command in self._reader.feed(data):
            if command.head_id == self._parameters.head_id and time >= self._silent_until:
                answers.extend(self._answer(command, time))
        return answers

    def _answer(self, command: SwitchCommand, time: float) -> List[Transmission]:
        fault = self.faults.next()
        if self._struck_dumb(fault, time):
            return []
        frame = self._ping(command, time, overrun=fault is Fault.OVERRUN).encode()
        # A command is complete when its last byte has arrived.
        begin = time + reply_begins(self._parameters, command) - ping_leaves(self._parameters)
        return self._transmissions(fault, frame, begin)

    def _garbled(self, frame: bytes) -> bytes:
        # The protocol has no checksum, so no driver can tell a garbled echo from a true one: the letters, the data
        # count or the terminator is always changed.
        return self.faults.garble(frame, range(HEADER_LENGTH, len(frame)), (0, 1, 2, 10, 11, len(frame) - 1))

    def _ping(self, command: SwitchCommand, time: float, overrun: bool) -> Reply:
        self._motion.obey(command)
        position = self._motion.position
        kind = command.reply_kind
        echoes = b""
        if kind.echo_count:
            gain_db = command.start_gain_db - _FULL_STRENGTH_DB
            ping = PingRequest(time, head_angle(position), kind.echo_count, command.max_range, gain_db)
            echoes = self._echoes(ping)
        self._motion.step(command)
        return Reply(
            kind=kind,
            head_id=self._parameters.head_id,
            status=_SONAR_STATUS | SWITCHES_ACCEPTED | (OVERRUN if overrun else 0),
            head_position=position,
            clockwise=self._motion.clockwise,
            max_range=command.max_range,
            echoes=echoes,
        )
