"""Faults of the emulated head and its cable, at random or on request."""

import random
from collections import Counter, deque
from dataclasses import dataclass, fields
from enum import Enum
from typing import Deque, Optional

from imagenex_852_driver.protocol.reply import HEADER_LENGTH
from node_support.parameters import ParameterError, ParameterSet, parameter


class Fault(Enum):
    """What can happen to one reply."""

    NONE = "none"
    DROPPED = "dropped"
    GARBLED = "garbled"
    TRUNCATED = "truncated"
    LATE = "late"
    DOUBLED = "doubled"
    OVERRUN = "overrun"
    SILENCE = "silence"
    DISAPPEARANCE = "disappearance"


@dataclass(frozen=True)
class FaultRates(ParameterSet):
    """How often each fault happens, as a share of the commands, and how long silence and absence last."""

    dropped: float = parameter(0.0, "share of replies lost", low=0.0, high=1.0)
    garbled: float = parameter(0.0, "share of replies with broken bytes", low=0.0, high=1.0)
    truncated: float = parameter(0.0, "share of replies cut short", low=0.0, high=1.0)
    late: float = parameter(0.0, "share of replies that come late", low=0.0, high=1.0)
    doubled: float = parameter(0.0, "share of replies sent twice", low=0.0, high=1.0)
    overrun: float = parameter(0.0, "share of replies that report a character overrun", low=0.0, high=1.0)
    silence: float = parameter(0.0, "share of commands after which the head falls silent", low=0.0, high=1.0)
    disappearance: float = parameter(0.0, "share of commands after which the port disappears", low=0.0, high=1.0)
    lateness: float = parameter(0.4, "delay of a late reply", unit="s", low=0.0, high=60.0)
    silence_duration: float = parameter(2.0, "length of a silence", unit="s", low=0.0, high=600.0)
    absence_duration: float = parameter(2.0, "time until the port is back", unit="s", low=0.0, high=600.0)

    def check(self) -> None:
        """Raise ParameterError when the shares add up to more than 1."""
        total = sum(self.rate(fault) for fault in Fault)
        if total > 1.0 + 1e-9:
            shares = ", ".join(f"{field.name} = {getattr(self, field.name)}" for field in fields(self)[:8])
            raise ParameterError(f"{shares}: more than 1 in all")

    def rate(self, fault: Fault) -> float:
        """Return the share of one fault; 0 for NONE, which gets the remaining share."""
        return 0.0 if fault is Fault.NONE else getattr(self, fault.value)


class FaultInjector:
    """Chooses a fault for every command and counts what it chose in `counts`."""

    def __init__(self, rates: Optional[FaultRates] = None, seed: int = 0) -> None:
        self.rates = rates or FaultRates()
        self.counts: Counter[Fault] = Counter()
        self._ordered: Deque[Fault] = deque()
        self._random = random.Random(seed)

    def order(self, fault: Fault, count: int = 1) -> None:
        """Apply `fault` to the next `count` commands for which no other fault has been ordered."""
        self._ordered.extend([fault] * count)

    def next(self) -> Fault:
        """Return the fault of the next command."""
        fault = self._ordered.popleft() if self._ordered else self._drawn()
        self.counts[fault] += 1
        return fault

    def garble(self, frame: bytes) -> bytes:
        """Return the frame with a tenth of its bytes changed, one of them where a driver can detect it.

        The protocol has no checksum, so no driver can tell a garbled echo from a true one: the header or the
        terminator is always changed.
        """
        result = bytearray(frame)
        for index in self._random.sample(range(HEADER_LENGTH, len(frame)), len(frame) // 10):
            result[index] ^= self._random.randint(1, 255)
        telling = self._random.choice([0, 1, 2, 10, 11, len(frame) - 1])
        result[telling] = frame[telling] ^ 0x55
        return bytes(result)

    def truncate(self, frame: bytes) -> bytes:
        """Return the beginning of the frame: at least one byte, but not the whole frame."""
        return frame[: self._random.randint(1, len(frame) - 1)]

    def _drawn(self) -> Fault:
        value = self._random.random()
        for fault in Fault:
            value -= self.rates.rate(fault)
            if value < 0:
                return fault
        return Fault.NONE
