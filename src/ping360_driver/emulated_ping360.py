"""A Ping360 in software: a state machine from messages to messages with the delays of motor, sound and line."""

from dataclasses import dataclass, replace
from typing import List, Optional

from node_support.parameters import parameter, with_defaults
from ping360_driver.messages import (
    CHECKSUM_LENGTH,
    HEADER_LENGTH,
    MessageId,
    MessageStream,
    PingMessage,
    packed,
    packed_nack,
)
from ping360_driver.scan_command import (
    AHEAD,
    PERIOD_TICKS,
    PING360,
    SAMPLES,
    TURN,
    PulseSettings,
    bin_length,
    head_angle,
    longest_pulse_us,
    pulse_of,
)
from sonar_driver.emulated_head import (
    EchoSource,
    EmulatedHead,
    EmulatedHeadParameters,
    Fault,
    FaultInjector,
    PingRequest,
    Transmission,
)

_HALF_TURN = TURN // 2
_FIRMWARES = {True: (3, 3, 1), False: (3, 1, 1)}  # With and without auto-transmit
_TURNING_TIME = 2.4 / TURN  # s per gradian: Ping Viewer's angular speed of the head
_ANSWER_TIME = 0.002  # s: what a processor needs for an answer that takes no ping
_STILL_UNREAD = 0.1  # s: nobody waits for the driver to read a beam before the head sends the next one
_GAINS_DB = (-6.0, 0.0, 6.0)  # Of the emulated echoes; the manufacturer gives no figures
# What the ping protocol allows in a command to ping.
_ALLOWED = {
    "gain_setting": range(3),
    "angle": range(TURN),
    "transmit_duration": range(1, 1001),
    "sample_period": range(PERIOD_TICKS[0], PERIOD_TICKS[1] + 1),
    "transmit_frequency": range(500, 1001),
    "number_of_samples": range(SAMPLES[0], SAMPLES[1] + 1),
    "start_angle": range(TURN),
    "stop_angle": range(TURN),
    "num_steps": range(1, 11),
    "delay": range(101),
}


@dataclass(frozen=True)
@with_defaults(beam_height_deg=25.0, beam_width_deg=2.0)
class EmulatorParameters(EmulatedHeadParameters):
    """Parameters of ping360_emulator."""

    refused: float = parameter(0.0, "share of replies instead of which the head refuses", low=0.0, high=1.0)
    link: str = parameter("/tmp/ping360", "path at which the port appears, or udp://HOST:PORT", tunable=False)
    auto_transmit: bool = parameter(
        True, "the firmware can scan a sector by itself; older ones need a request per ping", tunable=False
    )


class SectorScan:
    """Steps from start to stop; back again in a sector of up to half a turn, from the start again in a wider one."""

    def __init__(self, start: int, stop: int, step: int) -> None:
        self.angle = start
        self._start = start
        self._width = (stop - start) % TURN
        self._step = step
        self._clockwise = True

    def turn(self) -> int:
        """Go to the angle of the next ping; return by how many gradians the head turns."""
        position = (self.angle - self._start) % TURN
        following = position + (self._step if self._clockwise else -self._step)
        if not 0 <= following <= self._width and self._width > _HALF_TURN:
            following = 0
        elif not 0 <= following <= self._width:
            self._clockwise = not self._clockwise
            following = min(max(position + (self._step if self._clockwise else -self._step), 0), self._width)
        self.angle = (self._start + following) % TURN
        return min((following - position) % TURN, (position - following) % TURN)


class EmulatedPing360(EmulatedHead):
    """A Ping360 in software. A silence or a disappearance ends its scan, like a loss of power."""

    def __init__(
        self,
        parameters: Optional[EmulatorParameters] = None,
        echo_source: Optional[EchoSource] = None,
        faults: Optional[FaultInjector] = None,
    ) -> None:
        super().__init__(parameters or EmulatorParameters(), echo_source, faults)
        self._angle = AHEAD
        self._stream = MessageStream()
        self._scan: Optional[SectorScan] = None
        self._command: Optional[PingMessage] = None

    def receive(self, data: bytes, time: float) -> List[Transmission]:
        answers = []
        for parsed in self._stream.feed(data):
            if time >= self._silent_until:
                answers.extend(self._obey(parsed.message, time))
        return answers

    def advance(self, time: float) -> List[Transmission]:
        """Return the beam of the ping that is due at `time`, while the head scans by itself."""
        if time < self.next_event:
            return []
        ping_time = self.next_event
        self._angle = self._scan.angle
        sent = self._ping(self._command, ping_time, MessageId.AUTO_DEVICE_DATA)
        if self._scan is not None:
            turning = self._scan.turn() * _TURNING_TIME
            quiet = ping_time + _pulse(self._command).listening_time
            self.next_event = max(quiet, self._line_free) + turning + self._command.delay / 1000
        return sent

    def _obey(self, message: PingMessage, time: float) -> List[Transmission]:
        if message.message_id == MessageId.GENERAL_REQUEST:
            return self._answer(message.requested_id, time)
        if message.message_id == MessageId.MOTOR_OFF:
            self._rest()
            return self._at_once(packed(MessageId.ACK, acked_id=MessageId.MOTOR_OFF), time)
        if message.message_id not in (MessageId.TRANSDUCER, MessageId.AUTO_TRANSMIT):
            return []
        wrong = self._complaint(message)
        if wrong:
            return self._at_once(packed_nack(message.message_id, wrong), time)
        self._rest()
        if message.message_id == MessageId.TRANSDUCER:
            ping_time = time + self._turning_time_to(message.angle)
            self._angle = message.angle
            return self._ping(message, ping_time, MessageId.DEVICE_DATA)
        self._command, self._scan = message, SectorScan(message.start_angle, message.stop_angle, message.num_steps)
        self.next_event = time + self._turning_time_to(message.start_angle)
        return []

    def _answer(self, requested_id: int, time: float) -> List[Transmission]:
        if requested_id != MessageId.DEVICE_INFORMATION:
            return self._at_once(packed_nack(MessageId.GENERAL_REQUEST, "not known to the emulated head"), time)
        names = ("firmware_version_major", "firmware_version_minor", "firmware_version_patch")
        firmware = dict(zip(names, _FIRMWARES[self._parameters.auto_transmit]))
        return self._at_once(packed(MessageId.DEVICE_INFORMATION, device_type=PING360, **firmware), time)

    def _at_once(self, frame: bytes, time: float) -> List[Transmission]:
        return self._paced(frame, time + _ANSWER_TIME)

    def _complaint(self, message: PingMessage) -> str:
        if message.message_id == MessageId.AUTO_TRANSMIT and not self._parameters.auto_transmit:
            return "not known to this firmware"
        for name in message.payload_field_names:
            if getattr(message, name) not in _ALLOWED.get(name, range(0x10000)):
                return f"{name} out of range"
        return ""

    def _turning_time_to(self, angle: int) -> float:
        turn = (angle - self._angle) % TURN
        return min(turn, TURN - turn) * _TURNING_TIME

    def _ping(self, command: PingMessage, time: float, message_id: MessageId) -> List[Transmission]:
        fault = self.faults.next()
        if self._struck_dumb(fault, time, _STILL_UNREAD if message_id is MessageId.AUTO_DEVICE_DATA else 0.0):
            self._rest()
            return []
        if fault is Fault.REFUSED:
            self._rest()
            return self._at_once(packed_nack(command.message_id, "fault ordered"), time)
        frame = self._beam(command, time, message_id)
        return self._transmissions(fault, frame, time + _pulse(command).listening_time)

    def _beam(self, command: PingMessage, time: float, message_id: MessageId) -> bytes:
        pulse = _pulse(command)
        reach = pulse.number_of_samples * bin_length(pulse.sample_period, self._parameters.speed_of_sound)
        gain_db = _GAINS_DB[pulse.gain_setting]
        ping = PingRequest(time, head_angle(self._angle), pulse.number_of_samples, reach, gain_db)
        echoes = self._echoes(ping)
        told = {name: getattr(command, name) for name in command.payload_field_names}
        return packed(
            message_id,
            **{**told, **vars(pulse), "angle": self._angle, "data_length": len(echoes), "data": bytearray(echoes)},
        )

    def _rest(self) -> None:
        self._scan = self._command = None
        self.next_event = float("inf")

    def _garbled(self, frame: bytes) -> bytes:
        last = len(frame)
        telling = (*range(HEADER_LENGTH - 2), *range(last - CHECKSUM_LENGTH, last))
        return self.faults.garble(frame, range(HEADER_LENGTH, last), telling)


def _pulse(command: PingMessage) -> PulseSettings:
    asked = pulse_of(command)
    return replace(asked, transmit_duration=min(asked.transmit_duration, longest_pulse_us(asked.sample_period)))
