"""Pings of an emulated head that carry their numbers, and a record of what happened to each of them."""

from typing import List

from sonar_driver.emulator.emulated_head import EchoSource
from sonar_driver.emulator.faults import Fault, FaultInjector

# Faults of which no ping comes.
WITHOUT_PING = (Fault.SILENCE, Fault.DISAPPEARANCE, Fault.REFUSED)


class NumberedEchoes(EchoSource):
    """Writes the number of the ping into the first echoes."""

    def __init__(self):
        self.count = 0

    def echoes(self, ping):
        self.count += 1
        return (self.count - 1).to_bytes(4, "big") + bytes(ping.bin_count - 4)


class RecordingInjector(FaultInjector):
    """Remembers the fault of every ping, and stops the driver after a number of commands."""

    def __init__(self, rates, seed, commands, stop):
        super().__init__(rates, seed)
        self.of_pings: List[Fault] = []
        self._left = commands
        self._stop = stop

    def next(self):
        self._left -= 1
        if self._left < 0:
            self._stop.set()
            self.counts[Fault.DROPPED] += 1
            self.of_pings.append(Fault.DROPPED)
            return Fault.DROPPED
        fault = super().next()
        if fault not in WITHOUT_PING:
            self.of_pings.append(fault)
        return fault
