"""Drives an emulated head with every fault at a given rate and settles the accounts.

Command line: python3 fault_experiment.py [COMMANDS RATE]; 10,000 commands, a third of them with a fault, unless told
otherwise. RATE is the share of each of the eight faults.
"""

import os
import sys
from dataclasses import dataclass
from typing import List

sys.path.append(os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "sonar_driver"))

from numbered_pings import NumberedEchoes, RecordingInjector
from virtual_line import VirtualLine, VirtualStop, VirtualTime

from imagenex_852_driver.emulated_852 import Emulated852, EmulatorParameters
from imagenex_852_driver.line.device import DeviceStats, SonarDevice
from imagenex_852_driver.line.parameters import ConnectionParameters, HeadSettings
from sonar_driver.emulator.faults import Fault
from sonar_driver.line.device import Scanner

GOOD = (Fault.NONE, Fault.DOUBLED, Fault.OVERRUN)
# Beyond the longest wait for a reply.
LATENESS = 0.12


@dataclass(frozen=True)
class Account:
    """What the head did and what the driver made of it."""

    expected: List[int]
    delivered: List[int]
    faults: dict
    stats: DeviceStats
    seconds: float


def fault_rates(rate: float, reply_margin: float) -> EmulatorParameters:
    """Return `rate` for every fault; late replies come after the driver's wait, `reply_margin` s, is over."""
    names = ("dropped", "garbled", "truncated", "late", "doubled", "overrun", "silence", "disappearance")
    lasting = {"lateness": reply_margin + LATENESS, "silence_duration": 0.2, "absence_duration": 0.05}
    return EmulatorParameters(**dict.fromkeys(names, rate), **lasting)


def run(commands: int, rate: float, seed: int = 0, reply_margin: float = 0.1) -> Account:
    """Let the head see `commands` commands outside of silences, in virtual time; return the account."""
    time = VirtualTime()
    stop = VirtualStop(time)
    faults = RecordingInjector(fault_rates(rate, reply_margin), seed, commands, stop)
    connection = ConnectionParameters(reply_margin=reply_margin, late_window=2 * LATENESS, byte_gap=reply_margin / 2)
    timing = connection.timing()
    line = VirtualLine(Emulated852(NumberedEchoes(), faults, timing), timing.baud_rate, time)
    device = SonarDevice(connection, stop, time.elapsed, time.elapsed, line.open)
    delivered: List[int] = []
    scanner = Scanner(
        device,
        HeadSettings(max_range=50).command(),
        lambda ping: delivered.append(int.from_bytes(ping.reply.echoes[:4], "big")),
    )
    scanner.connect()
    scanner.run()
    expected = [number for number, fault in enumerate(faults.of_pings) if fault in GOOD]
    return Account(expected, delivered, dict(faults.counts), device.stats, time.now)


def main() -> None:
    """Print the account of a run."""
    commands, rate = (int(sys.argv[1]), float(sys.argv[2])) if len(sys.argv) > 2 else (10000, 1.0 / 24.0)
    account = run(commands, rate)
    faults = {fault.value: count for fault, count in account.faults.items()}
    print(f"{commands} commands, {account.seconds:.0f} s on the line: {faults}")
    print(account.stats)
    same = "the same in order" if account.expected == account.delivered else "NOT the same"
    print(f"{len(account.expected)} good replies sent, {len(account.delivered)} delivered, {same}")


if __name__ == "__main__":
    main()
