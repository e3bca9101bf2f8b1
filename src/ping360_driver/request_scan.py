"""Scans by asking for every single ping; what comes of one, and how long it takes at most."""

from dataclasses import dataclass
from typing import Dict, Optional

from ping360_driver.message_line import Arrival, MessageLine
from ping360_driver.messages import CHECKSUM_LENGTH, HEADER_LENGTH, MessageError, MessageId
from ping360_driver.scan_command import TURN, Beam, PulseSettings, ScanCommand, SectorWalk, beam, refusal
from sonar_driver.port import LineParameters, transmission_time

# s: a full turn takes 2.4 s by Ping Viewer's constants, and no command more than 4 s by the ping protocol.
_SLOWEST_TURN = 4.0
_BEAM_HEADER = 20  # Bytes of an AUTO_DEVICE_DATA message besides its samples; a DEVICE_DATA message has fewer
# A reply that begins within this share of the listening time is too early to be the answer.
_SURELY_TOO_EARLY = 0.9
_COUNTS = ("timeouts", "bad_frames", "refusals", "interrupted", "unexpected_replies", "missing_beams")


@dataclass
class Outcome:
    """A beam and when its ping left, in seconds of the line's clock, or what came instead; and what else came.

    `timeouts`, `bad_frames`, `refusals` and `interrupted` are pings without a beam. `unexpected_replies` and
    `missing_beams` are as in `Ping360Stats`. `error` says in words what was wrong.
    """

    beam: Optional[Beam] = None
    pinged: float = 0.0
    timeouts: int = 0
    bad_frames: int = 0
    refusals: int = 0
    interrupted: int = 0
    unexpected_replies: int = 0
    missing_beams: int = 0
    error: str = ""

    @property
    def is_over(self) -> bool:
        return self.beam is not None or bool(self._without_beam())

    def interrupt(self) -> None:
        """Note that the ping ended before its time, unless it has come to another end already; a timeout is none."""
        self.timeouts = 0
        if not self.is_over:
            self.interrupted, self.error = 1, ""

    def counts(self) -> Dict[str, int]:
        """Return what is added to the counts of the device."""
        replies = int(self.beam is not None)
        return {"pings": replies + self._without_beam(), "replies": replies, **{n: getattr(self, n) for n in _COUNTS}}

    def _without_beam(self) -> int:
        return self.timeouts + self.bad_frames + self.refusals + self.interrupted


def turning_time(gradians: int) -> float:
    """Return how long the head takes at most to turn by so many gradians, in seconds."""
    return _SLOWEST_TURN * gradians / TURN


def beam_time(step: int, pulse: PulseSettings, baud_rate: float) -> float:
    """Return how long it takes at most from one beam to the next, `step` gradians further, in seconds.

    baud_rate: bits per second.
    """
    length = HEADER_LENGTH + _BEAM_HEADER + pulse.number_of_samples + CHECKSUM_LENGTH
    return turning_time(step) + pulse.listening_time + transmission_time(length, baud_rate)


class RequestScan:
    """Sends one request at a time. The angle of a beam tells which request it answers."""

    def __init__(self, line: MessageLine, connection: LineParameters, baud_rate: float) -> None:
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
