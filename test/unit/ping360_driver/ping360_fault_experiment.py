"""Drives an emulated Ping360 with every fault at a given rate, in virtual time, and settles the accounts.

Command line: python3 ping360_fault_experiment.py [auto_transmit | request] [REPLIES RATE]; 10,000 replies, a third of
them with a fault, unless told otherwise. RATE is the share of each of the eight faults.
"""

import os
import sys
from dataclasses import dataclass
from typing import List, Set

sys.path.append(os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "sonar_driver"))

from numbered_pings import RecordingInjector
from ping360_line import BAUD_RATE, SETTINGS, connection_to, emulated, number
from virtual_line import VirtualLine, VirtualStop, VirtualTime

from ping360_driver.emulated_ping360 import EmulatorParameters
from ping360_driver.line.device import Ping360Device, Ping360Stats
from ping360_driver.protocol.scan_command import ScanMode
from sonar_driver.emulator.faults import Fault
from sonar_driver.line.device import Scanner


@dataclass(frozen=True)
class Account:
    """What the head did and what the driver made of it.

    `expected`: numbers of the pings whose replies were good. `optional`: of those that the driver may take or leave, as
    they came late: a request is answered in time if the head was given the time for a whole turn.
    """

    expected: List[int]
    optional: Set[int]
    delivered: List[int]
    faults: dict
    stats: Ping360Stats
    seconds: float


def fault_rates(rate: float) -> EmulatorParameters:
    """Return `rate` for every fault."""
    lasting = {"lateness": 0.3, "silence_duration": 0.4, "absence_duration": 0.2}
    return EmulatorParameters(**dict.fromkeys((fault.value for fault in EmulatorParameters.known()), rate), **lasting)


def run(mode: ScanMode, commands: int, rate: float, seed: int = 0) -> Account:
    """Let the head send or spoil `commands` replies; return the account."""
    time = VirtualTime()
    stop = VirtualStop(time)
    faults = RecordingInjector(fault_rates(rate), seed, commands, stop)
    line = VirtualLine(emulated("virtual", faults), BAUD_RATE, time)
    device = Ping360Device(connection_to("virtual", reply_margin=0.15), stop, time.elapsed, time.elapsed, line.open)
    delivered: List[int] = []
    command = SETTINGS.changed({"scan_mode": mode.value}).command()
    scanner = Scanner(device, command, lambda ping: delivered.append(number(ping)))
    scanner.connect()
    scanner.run()
    by_itself = mode is ScanMode.AUTO_TRANSMIT
    good = (Fault.NONE, Fault.DOUBLED, Fault.LATE) if by_itself else (Fault.NONE, Fault.DOUBLED)
    expected = [number for number, fault in enumerate(faults.of_pings) if fault in good]
    optional = {number for number, fault in enumerate(faults.of_pings) if fault is Fault.LATE and not by_itself}
    return Account(expected, optional, delivered, dict(faults.counts), device.stats, time.now)


def main(mode: str = "auto_transmit", commands: str = "10000", rate: str = str(1 / 24)) -> None:
    """Print the account of a run."""
    account = run(ScanMode(mode), int(commands), float(rate))
    faults = {fault.value: count for fault, count in account.faults.items()}
    print(f"{commands} replies, {account.seconds:.0f} s on the line: {faults}")
    print(account.stats)
    taken = [one for one in account.delivered if one not in account.optional]
    same = "the same in order" if account.expected == taken else "NOT the same"
    late = len(account.delivered) - len(taken)
    print(f"{len(account.expected)} good replies sent, {len(taken)} delivered, {same}; {late} late ones taken")


if __name__ == "__main__":
    main(*sys.argv[1:])
