"""The emulated head: a state machine from commands to replies with the delays of sound and line."""

from typing import List, NamedTuple, Optional

from imagenex_852_driver.emulator.echo_source import EchoSource, FixedPattern, PingRequest
from imagenex_852_driver.emulator.faults import Fault, FaultInjector
from imagenex_852_driver.emulator.head_rotation import HeadRotation
from imagenex_852_driver.line.timing import LineTiming
from imagenex_852_driver.protocol import CommandReader, Reply, SwitchCommand
from imagenex_852_driver.protocol.angles import head_angle
from imagenex_852_driver.protocol.errors import SONAR_HEAD_ID
from imagenex_852_driver.protocol.reply import OVERRUN, SWITCHES_ACCEPTED

_SONAR_STATUS = 0x01  # Status of a head that is a sonar, not a profiler (manufacturer's specification)
# A serial adapter passes on the bytes of a reply in pieces of about this size.
_PIECE = 64


class Transmission(NamedTuple):
    """Bytes that leave the head at `time` (seconds of the caller's clock)."""

    time: float
    data: bytes


class EmulatedHead:
    """An Imagenex 852 in software: bytes and times in, bytes and times out, without its own clock or port.

    It answers only commands that carry its identification, with the commanded range, number of points, gain and
    delay, and turns as commanded. Until the time `absent_until`, whoever serves it removes the port.
    """

    def __init__(
        self,
        echo_source: Optional[EchoSource] = None,
        faults: Optional[FaultInjector] = None,
        timing: Optional[LineTiming] = None,
        head_id: int = SONAR_HEAD_ID,
    ) -> None:
        self.faults = faults or FaultInjector()
        self.absent_until = float("-inf")
        self._echo_source = echo_source or FixedPattern()
        self._timing = timing or LineTiming()
        self._head_id = head_id
        self._silent_until = float("-inf")
        self._line_free = float("-inf")
        self.reboot()

    def reboot(self) -> None:
        """Discard an unfinished command, the position and the direction, as after a loss of power."""
        self._reader = CommandReader()
        self._motion = HeadRotation()

    def receive(self, data: bytes, time: float) -> List[Transmission]:
        """Take bytes that arrived at `time`; return what the head sends in reply, in order of time."""
        answers = []
        for command in self._reader.feed(data):
            if command.head_id == self._head_id:
                answers.extend(self._answer(command, time))
        return answers

    def _answer(self, command: SwitchCommand, time: float) -> List[Transmission]:
        if time < self._silent_until:
            return []
        fault = self.faults.next()
        rates = self.faults.rates
        if fault is Fault.SILENCE:
            self._silent_until = time + rates.silence_duration
            return []
        if fault is Fault.DISAPPEARANCE:
            self.absent_until = time + rates.absence_duration
            return []
        frame = self._ping(command, time, overrun=fault is Fault.OVERRUN).encode()
        lateness = rates.lateness if fault is Fault.LATE else 0.0
        # A command is complete when its last byte has arrived.
        begin = time + self._timing.reply_begins(command) - self._timing.ping_leaves() + lateness
        return self._paced(self._spoilt(fault, frame), begin)

    def _spoilt(self, fault: Fault, frame: bytes) -> bytes:
        if fault is Fault.DROPPED:
            return b""
        if fault is Fault.GARBLED:
            return self.faults.garble(frame)
        if fault is Fault.TRUNCATED:
            return self.faults.truncate(frame)
        return frame * 2 if fault is Fault.DOUBLED else frame

    def _ping(self, command: SwitchCommand, time: float, overrun: bool) -> Reply:
        self._motion.obey(command)
        position = self._motion.position
        kind = command.reply_kind
        echoes = b""
        if kind.echo_count:
            ping = PingRequest(time, head_angle(position), kind.echo_count, command)
            echoes = self._echo_source.echoes(ping)
        self._motion.step(command)
        return Reply(
            kind=kind,
            head_id=self._head_id,
            status=_SONAR_STATUS | SWITCHES_ACCEPTED | (OVERRUN if overrun else 0),
            head_position=position,
            clockwise=self._motion.clockwise,
            max_range=command.max_range,
            echoes=echoes,
        )

    def _paced(self, data: bytes, begin: float) -> List[Transmission]:
        begin = max(begin, self._line_free)
        pieces = []
        for start in range(0, len(data), _PIECE):
            piece = data[start : start + _PIECE]
            pieces.append(Transmission(begin + self._timing.transmission(start + len(piece)), piece))
        if pieces:
            self._line_free = pieces[-1].time
        return pieces
