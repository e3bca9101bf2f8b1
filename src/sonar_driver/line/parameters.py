"""Parameters that every driver has: the line, and how its beams are published."""

from dataclasses import dataclass

from node_support.parameters import ParameterError, ParameterSet, parameter


@dataclass(frozen=True)
class LineParameters(ParameterSet):
    """Where the head is connected, how long the driver waits for it, and how it reconnects."""

    port: str = parameter("/dev/ttyUSB0", "device or pyserial URL (socket://, rfc2217://, loop://)", tunable=False)
    baud_rate: int = parameter(115200, "speed of the line, 8N1", unit="bit/s", low=1200, tunable=False)
    back_off_first: float = parameter(
        0.1, "wait before the first attempt to reopen the port", unit="s", low=0.01, high=1.0, tunable=False
    )
    back_off_longest: float = parameter(
        1.0, "longest wait between attempts; each wait is twice the previous one",
        unit="s", low=0.01, high=1.5, tunable=False,
    )  # fmt: skip
    reopen_after: float = parameter(
        5.0, "reopen the port after so long without a reply", unit="s", low=0.1, tunable=False
    )
    reply_margin: float = parameter(
        0.25, "how long to wait for a reply beyond the time that head, sound and line need",
        unit="s", low=0.01, high=4.0, tunable=False,
    )  # fmt: skip
    late_window: float = parameter(
        0.25, "how long to wait after a timeout for a late reply, so that the next ping does not get it",
        unit="s", low=0.0, high=4.0, tunable=False,
    )  # fmt: skip
    byte_gap: float = parameter(0.1, "silence that ends part of a reply", unit="s", low=0.01, high=1.0, tunable=False)

    def check(self) -> None:
        """Raise ParameterError if the first wait is longer than the longest."""
        super().check()
        if self.back_off_first > self.back_off_longest:
            raise ParameterError(
                f"back_off_first = {self.back_off_first}: longer than back_off_longest = {self.back_off_longest}"
            )


@dataclass(frozen=True)
class MountingParameters(ParameterSet):
    """How the head is mounted."""

    frame_id: str = parameter("sonar", "frame of the head, in which it tilts but does not turn", tunable=False)
    inverted: bool = parameter(False, "the head is mounted upside down")
    sensor_joint: str = parameter(
        "", "joint of /joint_states that tilts the head, for sensorAngle; empty: none",
        tunable=False, may_be_empty=True,
    )  # fmt: skip
