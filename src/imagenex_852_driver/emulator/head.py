"""The emulated head: a state machine from commands to replies with the delays of sound and line."""

from typing import List, Optional

from imagenex_852_driver.emulator.head_rotation import HeadRotation
from imagenex_852_driver.emulator.parameters import FaultRates852
from imagenex_852_driver.line.timing import LineTiming
from imagenex_852_driver.protocol import CommandReader, Reply, SwitchCommand
from imagenex_852_driver.protocol.angles import head_angle
from imagenex_852_driver.protocol.errors import SONAR_HEAD_ID
from imagenex_852_driver.protocol.reply import HEADER_LENGTH, OVERRUN, SWITCHES_ACCEPTED
from sonar_driver.emulator import (
    EchoSource,
    EmulatedHead,
    Fault,
    FaultInjector,
    FixedPattern,
    PingRequest,
    Transmission,
)

_SONAR_STATUS = 0x01  # Status of a head that is a sonar, not a profiler (manufacturer's specification)
_FULL_STRENGTH_DB = 20  # Start gain at which an echo has its usual strength


class Emulated852(EmulatedHead):
    """An Imagenex 852 in software.

    It answers only commands that carry its identification, with the commanded range, number of points, gain and
    delay, and turns as commanded.
    """

    def __init__(
        self,
        echo_source: Optional[EchoSource] = None,
        faults: Optional[FaultInjector] = None,
        timing: Optional[LineTiming] = None,
        head_id: int = SONAR_HEAD_ID,
    ) -> None:
        self._timing = timing or LineTiming()
        super().__init__(faults or FaultInjector(FaultRates852()), self._timing.baud_rate)
        self._echo_source = echo_source or FixedPattern()
        self._head_id = head_id
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
        if self._struck_dumb(fault, time):
            return []
        frame = self._ping(command, time, overrun=fault is Fault.OVERRUN).encode()
        # A command is complete when its last byte has arrived.
        begin = time + self._timing.reply_begins(command) - self._timing.ping_leaves()
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
