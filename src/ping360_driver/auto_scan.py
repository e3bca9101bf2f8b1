"""Scans that the head does by itself, sending one beam after the other."""

from typing import Optional

from ping360_driver.message_line import Arrival, MessageLine
from ping360_driver.messages import MessageError, MessageId
from ping360_driver.request_scan import Outcome, beam_time, pinged, turning_time
from ping360_driver.scan_command import INFORMATION_REQUEST, MOTOR_OFF, TURN, Beam, ScanCommand, beam, refusal
from sonar_driver.port import LineParameters

_PATIENCE = 2  # Beams that have to be missing before the head counts as silent
_ANSWER_TIME = 0.3  # s: within this time a head that is alive answers a question
# s: a command was lost if the head still does something else after this time.
_OBEDIENCE_TIME = 2.0


class AutoScan:
    """Tells the head once what to scan, then takes its beams; tells it again when it fell silent or did not listen."""

    def __init__(
        self,
        line: MessageLine,
        connection: LineParameters,
        baud_rate: float,
        can_interrupt: bool,
        has_scanned: bool = False,
    ) -> None:
        """`can_interrupt`: a head that sends on two wires does not listen, unless the line is interrupted.

        `has_scanned`: this head is known to scan by itself, from before the port was lost.
        """
        self.refused = False
        self.has_scanned = has_scanned
        self._line = line
        self._margin = connection.reply_margin
        self._baud_rate = baud_rate
        self._can_interrupt = can_interrupt
        self._running: Optional[ScanCommand] = None
        self._started = 0.0
        self._is_alive = False
        self._last: Optional[Beam] = None
        self._last_frame = b""

    def ping(self, command: ScanCommand, outcome: Outcome) -> None:
        """Wait for the next beam of the scan; note in `outcome` what comes."""
        if command != self._running:
            self._start(command)
        patience = _PATIENCE * beam_time(command.step, command.pulse, self._baud_rate) + self._margin
        self._wait(outcome, command, patience)
        while not outcome.is_over and self._is_turning() and self._answers(outcome, command):
            self._wait(outcome, command, patience)
        if not outcome.is_over:
            self._revive(outcome, command)

    def end(self) -> None:
        if self._running is None:
            return
        if self._can_interrupt:
            self._line.interrupt()
        self._line.send(MOTOR_OFF)
        self._running = None

    def _start(self, command: ScanCommand) -> None:
        if self._running is not None and self._can_interrupt:
            self._line.interrupt()
        self._started = self._line.send(command.auto_transmit())
        self._running = command
        self._last = None

    def _revive(self, outcome: Outcome, command: ScanCommand) -> None:
        """Start the scan again as soon as the head answers; give up where it never scanned."""
        is_alive = self._answers(outcome, command)
        if outcome.is_over:
            return
        outcome.timeouts, outcome.error = 1, "the head fell silent"
        if is_alive and self.has_scanned:
            self._start(command)
        elif is_alive:
            self.refused, outcome.error = True, "the head does not scan by itself"

    def _answers(self, outcome: Outcome, command: ScanCommand) -> bool:
        """Return whether the head answers a question; a beam that comes instead is kept."""
        self._is_alive = False
        self._line.send(INFORMATION_REQUEST)
        self._wait(outcome, command, _ANSWER_TIME, until_alive=True)
        return self._is_alive

    def _is_turning(self) -> bool:
        """Return whether the head may still be on its way to the start of the sector."""
        return self._last is None and self._line.elapsed() < self._started + turning_time(TURN)

    def _wait(self, outcome: Outcome, command: ScanCommand, patience: float, until_alive: bool = False) -> None:
        deadline = self._line.elapsed() + patience
        while not outcome.is_over and not (until_alive and self._is_alive):
            arrival = self._line.receive(deadline)
            broken = self._line.take_broken()
            if broken:
                outcome.bad_frames += broken
                outcome.error = "a broken message"
            if arrival is None:
                return
            self._take(outcome, arrival, command)

    def _take(self, outcome: Outcome, arrival: Arrival, command: ScanCommand) -> None:
        message_id = arrival.message.message_id
        if message_id == MessageId.AUTO_DEVICE_DATA:
            self._judge(outcome, arrival, command)
        elif message_id == MessageId.DEVICE_INFORMATION:
            self._is_alive = True
        elif message_id == MessageId.NACK:
            outcome.refusals, outcome.error = 1, refusal(arrival.message)
            if arrival.message.nacked_id == MessageId.AUTO_TRANSMIT:
                self.refused = not self.has_scanned
                self._running = None

    def _judge(self, outcome: Outcome, arrival: Arrival, command: ScanCommand) -> None:
        # The protocol does not number messages; two pings never sound alike to the last bit.
        if arrival.frame == self._last_frame:
            outcome.unexpected_replies += 1
            outcome.error = "a reply came twice"
            return
        try:
            found = beam(arrival.message)
        except MessageError as error:
            outcome.bad_frames, outcome.error = outcome.bad_frames + 1, str(error)
            return
        if not self._obeyed(found, command) and self._line.elapsed() > self._started + _OBEDIENCE_TIME:
            outcome.error = "the head does not scan as commanded; the command is sent again"
            self._start(command)
        outcome.missing_beams += self._missing_before(found, command)
        outcome.beam, outcome.pinged = found, pinged(found, arrival)
        self.has_scanned = True
        self._last, self._last_frame = found, arrival.frame

    def _obeyed(self, found: Beam, command: ScanCommand) -> bool:
        """Return whether a beam is of this scan; the head may shorten a pulse that is too long for it."""
        asked, got = vars(command.pulse), vars(found.pulse)
        differing = {name for name in asked if asked[name] != got[name]}
        return differing <= {"transmit_duration"} and found.sector == (command.start, command.stop, command.step)

    def _missing_before(self, found: Beam, command: ScanCommand) -> int:
        if self._last is None or not command.is_full_turn:
            return 0
        turned = (found.angle - self._last.angle) % TURN
        return 0 if turned % command.step else max(0, turned // command.step - 1)
