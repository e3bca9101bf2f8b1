"""Drives an emulated Ping360 with every fault at a given rate and settles the accounts.

Command line:
    python3 ping360_fault_experiment.py [replies] [rate of each fault] [auto_transmit | request] [serial | udp]
"""

import os
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from typing import List, Set

sys.path.append(os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "sonar_driver"))

from numbered_pings import RecordingInjector
from ping360_line import SETTINGS, connection_to, emulated, number, served_line

from ping360_driver.emulator import Ping360FaultRates
from ping360_driver.line.device import Ping360Device
from ping360_driver.line.stats import Ping360Stats
from ping360_driver.protocol.scan_command import ScanMode
from sonar_driver.emulator import Fault, HeadServer
from sonar_driver.line.scanner import Scanner

UDP_PORT = "udp://127.0.0.1:23460"


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


def fault_rates(rate: float) -> Ping360FaultRates:
    """Return `rate` for every fault."""
    lasting = {"lateness": 0.3, "silence_duration": 0.4, "absence_duration": 0.2}
    return Ping360FaultRates(**dict.fromkeys((fault.value for fault in Ping360FaultRates.known()), rate), **lasting)


def run(port: str, mode: ScanMode, commands: int, rate: float, seed: int = 0) -> Account:
    """Let the head send or spoil `commands` replies; return the account."""
    stop = threading.Event()
    faults = RecordingInjector(fault_rates(rate), seed, commands, stop)
    delivered: List[int] = []
    device = Ping360Device(connection_to(port), stop)
    command = SETTINGS.changed({"scan_mode": mode.value}).command()
    scanner = Scanner(device, command, lambda ping: delivered.append(number(ping)))
    begin = time.monotonic()
    with HeadServer(emulated(port, faults), served_line(port)):
        scanner.connect()
        scanner.run()
    seconds = time.monotonic() - begin
    by_itself = mode is ScanMode.AUTO_TRANSMIT
    good = (Fault.NONE, Fault.DOUBLED, Fault.LATE) if by_itself else (Fault.NONE, Fault.DOUBLED)
    expected = [number for number, fault in enumerate(faults.of_pings) if fault in good]
    optional = {number for number, fault in enumerate(faults.of_pings) if fault is Fault.LATE and not by_itself}
    return Account(expected, optional, delivered, dict(faults.counts), device.stats, seconds)


def main(commands: int = 10000, rate: float = 0.05, mode: str = "auto_transmit", line: str = "serial") -> None:
    """Run the experiment and print what came of it."""
    with tempfile.TemporaryDirectory() as directory:
        port = UDP_PORT if line == "udp" else f"{directory}/sonar"
        account = run(port, ScanMode(mode), int(commands), float(rate))
    print({fault.value: count for fault, count in account.faults.items()})
    print(account.stats)
    taken = [one for one in account.delivered if one not in account.optional]
    print(f"{len(account.expected)} good replies sent, {len(taken)} delivered,", end=" ")
    print("the same in order" if account.expected == taken else "NOT the same", end=", ")
    print(f"{len(account.delivered) - len(taken)} late ones, {account.seconds:.0f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
