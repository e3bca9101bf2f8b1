"""The head on its line: greets it, chooses who turns it, stamps its beams, and counts."""

from dataclasses import dataclass, field
from typing import Any, Dict, Optional, Union

from ping360_driver.auto_scan import AutoScan
from ping360_driver.message_line import MessageLine
from ping360_driver.messages import MessageId, PingMessage
from ping360_driver.request_scan import Outcome, RequestScan
from ping360_driver.scan_command import (
    INFORMATION_REQUEST,
    LAST_WITHOUT_AUTO_TRANSMIT,
    MOTOR_OFF,
    PING360,
    TICK,
    Beam,
    PulseSettings,
    ScanCommand,
    ScanMode,
    firmware_of,
)
from sonar_driver.device import LineDevice, LineStats
from sonar_driver.port import LineParameters, Port, PortUnavailableError, is_datagram_port

_GREETINGS = 3
_ANSWER_TIME = 0.3  # s: a head at rest answers within a few milliseconds; one that scans, between two beams
_CLOCK_TOLERANCE = 1e-3  # s: a vehicle goes a millimetre in it
_CLOCK_READINGS = 5


@dataclass(frozen=True)
class Ping360Stats(LineStats):
    """Counts since the start, and what the newest beam says of itself.

    `refusals`: commands that the head did not accept. `missing_beams`: directions of a full turn of which no beam came
    while the head scanned by itself; each of them was also a bad frame if its bytes arrived broken.
    """

    refusals: int = 0
    missing_beams: int = 0
    firmware: str = ""
    mode: str = ScanMode.AUTO_TRANSMIT.value
    pulse: PulseSettings = field(default_factory=PulseSettings)
    problems = {  # noqa: RUF012
        "timeouts": "no reply; check the head's power and the cable",
        "bad frames": "a broken message; check the cable, lower baud_rate",
        "unexpected replies": "a reply came late or twice and was dropped",
        "refusals": "the head did not accept a command; the last error names it",
        "missing beams": "the head scanned on, but not every beam arrived; check the cable, lower baud_rate",
    }

    def details(self) -> Dict[str, str]:
        """Return what else /diagnostics shows: firmware, who turns the head, and the pulse as the head reports it."""
        return {
            "firmware": self.firmware,
            "scan mode": self.mode,
            "gain setting": str(self.pulse.gain_setting),
            "frequency [kHz]": str(self.pulse.transmit_frequency),
            "transmit duration [us]": str(self.pulse.transmit_duration),
            "sample period [us]": f"{1e6 * self.pulse.sample_period * TICK:.3f}",
            "samples": str(self.pulse.number_of_samples),
        }


@dataclass(frozen=True)
class Ping:
    """A beam, and the time at which the ping left, in seconds of the device's clock."""

    stamp: float
    beam: Beam


class Ping360Device(LineDevice[ScanCommand, Ping]):
    """Gets beams from a head that scans by itself, or that is asked for every ping where it cannot."""

    zero = Ping360Stats()

    def __init__(self, connection: LineParameters, *arguments: Any, **options: Any) -> None:
        super().__init__(connection, *arguments, **options)
        self._is_serial = not is_datagram_port(connection.port)
        self._baud_rate = connection.baud_rate if self._is_serial else float("inf")
        self._line: Optional[MessageLine] = None
        self._can_auto_transmit = False
        self._auto: Optional[AutoScan] = None
        self._requests: Optional[RequestScan] = None

    def _greet(self) -> None:
        self._line = MessageLine(self._port, self._baud_rate, self.connection.byte_gap, self.stop, self.elapsed)
        if self._is_serial:
            self._line.interrupt()
        firmware = firmware_of(self._who_is_there())
        self._can_auto_transmit = firmware > LAST_WITHOUT_AUTO_TRANSMIT
        has_scanned = self._auto is not None and self._auto.has_scanned
        self._auto = AutoScan(self._line, self.connection, self._baud_rate, self._is_serial, has_scanned)
        self._requests = RequestScan(self._line, self.connection, self._baud_rate)
        self._note(firmware=".".join(str(number) for number in firmware))

    def _who_is_there(self) -> PingMessage:
        for _ in range(_GREETINGS):
            self._line.send(INFORMATION_REQUEST)
            deadline = self.elapsed() + _ANSWER_TIME
            while self.elapsed() < deadline and not self.stop.is_set():
                arrival = self._line.receive(deadline)
                if arrival is not None and arrival.message.message_id == MessageId.DEVICE_INFORMATION:
                    device_type = arrival.message.device_type
                    if device_type == PING360:
                        return arrival.message
                    raise PortUnavailableError(
                        f"what answers at {self.connection.port} is no Ping360: device_type = {device_type}"
                    )
                self._line.take_broken()
        raise PortUnavailableError(f"no Ping360 answers at {self.connection.port}; check power, cable and baud_rate")

    def _take_leave(self, port: Port) -> None:
        if self._is_serial:
            port.send_break()
        port.write(MOTOR_OFF)

    def _ping(self, command: ScanCommand) -> Optional[Ping]:
        outcome = Outcome()
        try:
            self._scan(command).ping(command, outcome)
            if self.stop.is_set():
                outcome.interrupt()
        except BaseException:
            outcome.interrupt()
            raise
        finally:
            for name, number in outcome.counts().items():
                if number:
                    self._count(name, outcome.error, number)
        if outcome.beam is None:
            return None
        self._note(pulse=outcome.beam.pulse)
        return Ping(self._stamp(outcome.pinged), outcome.beam)

    def _stamp(self, moment: float) -> float:
        """Return what the clock of stamps said at a moment of the line's clock.

        A process that was interrupted between the two clocks reads them again.
        """
        for _ in range(_CLOCK_READINGS):
            before = self.elapsed()
            stamp = self._clock()
            if self.elapsed() - before < _CLOCK_TOLERANCE:
                break
        return stamp - (before - moment)

    def _scan(self, command: ScanCommand) -> Union[AutoScan, RequestScan]:
        by_itself = command.can_auto_transmit and self._can_auto_transmit and not self._auto.refused
        if not by_itself:
            self._auto.end()
        mode = ScanMode.AUTO_TRANSMIT if by_itself else ScanMode.REQUEST
        if mode.value != self.stats.mode:
            self._note(mode=mode.value)
        return self._auto if by_itself else self._requests
