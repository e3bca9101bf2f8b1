"""Scans by asking for every single ping."""

from typing import Optional

from ping360_driver.line.beam_time import beam_time
from ping360_driver.line.message_line import Arrival, MessageLine
from ping360_driver.line.outcome import Outcome
from ping360_driver.line.parameters import ConnectionParameters
from ping360_driver.protocol.angles import TURN
from ping360_driver.protocol.messages import MessageError, MessageId
from ping360_driver.protocol.replies import Beam, beam, refusal
from ping360_driver.protocol.scan_command import ScanCommand
from ping360_driver.protocol.sector_walk import SectorWalk

# A reply that begins within this share of the listening time is too early to be the answer.
_SURELY_TOO_EARLY = 0.9


class RequestScan:
    """Sends one request at a time. The angle of a beam tells which request it answers."""

    def __init__(self, line: MessageLine, connection: ConnectionParameters, baud_rate: float) -> None:
        self._line = line
        self._margin = connection.reply_margin
        self._late_window = connection.late_window
        self._baud_rate = baud_rate
        self._walk = SectorWalk()
        self._last_angle: Optional[int] = None

    def ping(self, command: ScanCommand, outcome: Outcome) -> None:
        """Ask for the next ping of the scan and wait for it; note in `outcome` what comes."""
        angle = self._walk.next(command)
        sent = self._line.send(command.transducer(angle))
        deadline = sent + beam_time(self._turn_to(angle), command.pulse, self._baud_rate) + self._margin
        earliest = sent + _SURELY_TOO_EARLY * command.pulse.listening_time
        self._wait(outcome, angle, earliest, deadline)
        if outcome.timeouts:
            self._await_late_reply(outcome)
        if outcome.bad_frames:
            self._line.drain()
        self._last_angle = angle

    def _await_late_reply(self, outcome: Outcome) -> None:
        """Let the head finish, so that it is free for the next request."""
        deadline = self._line.elapsed() + self._late_window
        while not outcome.unexpected_replies and self._line.elapsed() < deadline:
            arrival = self._line.receive(deadline)
            if arrival is not None and arrival.message.message_id == MessageId.DEVICE_DATA:
                outcome.unexpected_replies += 1
            elif arrival is None:
                return

    def _turn_to(self, angle: int) -> int:
        """Return by how many gradians the head turns at most; it may go either way, and be anywhere at first."""
        if self._last_angle is None:
            return TURN
        shorter = (angle - self._last_angle) % TURN
        return min(shorter, TURN - shorter)

    def _wait(self, outcome: Outcome, angle: int, earliest: float, deadline: float) -> None:
        while not outcome.is_over:
            arrival = self._line.receive(deadline)
            broken = self._line.take_broken()
            if arrival is not None and arrival.message.message_id == MessageId.NACK:
                outcome.refusals, outcome.error = 1, refusal(arrival.message)
            elif arrival is not None and arrival.message.message_id == MessageId.DEVICE_DATA:
                self._judge(outcome, arrival, angle, earliest)
            elif arrival is None and not broken:
                outcome.timeouts, outcome.error = 1, "no beam in time"
            if broken and not outcome.is_over:
                outcome.bad_frames, outcome.error = 1, "a broken message"

    def _judge(self, outcome: Outcome, arrival: Arrival, angle: int, earliest: float) -> None:
        try:
            found = beam(arrival.message)
        except MessageError as error:
            outcome.bad_frames, outcome.error = 1, str(error)
            return
        if found.angle != angle or arrival.begun < earliest or not found.echoes:
            outcome.unexpected_replies += 1
            outcome.error = "a reply came late or twice"
            return
        outcome.beam, outcome.pinged = found, pinged(found, arrival)


def pinged(found: Beam, arrival: Arrival) -> float:
    """Return when the ping of a beam left: the head sends once it has listened. Seconds of the line's clock."""
    return arrival.begun - found.pulse.listening_time
