"""Drives an emulated head with every fault at a given rate, in virtual time, and settles the accounts.

Command line: python3 fault_experiment.py [imagenex_852 | ping360 | ping360_requests] [REPLIES RATE]; 10,000 replies, a
third of them with a fault, unless told otherwise. RATE is the share of each of the eight faults.
"""

import sys
from dataclasses import dataclass
from typing import List, Set

from emulated_drivers import EXACT, SONARS, RecordingInjector, Sonar, VirtualScan
from virtual_line import VirtualTime

from sonar_driver.device import LineStats

# s: how long after the longest wait for a reply a late one comes.
LATENESS = 0.15


@dataclass(frozen=True)
class Account:
    """What the head did and what the driver made of it.

    `expected`: numbers of the pings whose beams must be delivered. `optional`: of those that may be.
    """

    expected: List[int]
    optional: Set[int]
    delivered: List[int]
    faults: dict
    stats: LineStats
    seconds: float

    @property
    def taken(self) -> List[int]:
        """Numbers of the pings that were delivered, without the optional ones."""
        return [number for number in self.delivered if number not in self.optional]


def fault_rates(sonar, rate, reply_margin):
    """Return `rate` for every fault; late replies come after the driver's wait, `reply_margin` s, is over."""
    lasting = {"lateness": reply_margin + LATENESS, "silence_duration": 0.4, "absence_duration": 0.2}
    return sonar.rates(**dict.fromkeys((fault.value for fault in sonar.rates.known()), rate), **lasting)


def run(sonar: Sonar, commands: int = 10000, rate: float = 1.0 / 24.0, seed: int = 0) -> Account:
    """Let the head send or spoil `commands` replies; return the account."""
    time = VirtualTime()
    faults = RecordingInjector(fault_rates(sonar, rate, EXACT["reply_margin"]), seed, commands, time)
    scan = VirtualScan(sonar, faults=faults, time=time)
    scan.scan()
    expected = [number for number, fault in enumerate(faults.of_pings) if fault in sonar.good]
    optional = {number for number, fault in enumerate(faults.of_pings) if fault in sonar.optional}
    return Account(expected, optional, scan.numbers, dict(faults.counts), scan.stats, time.now)


def main(name: str = "imagenex_852", commands: str = "10000", rate: str = str(1 / 24)) -> None:
    """Print the account of a run."""
    account = run(SONARS[name], int(commands), float(rate))
    faults = {fault.value: count for fault, count in account.faults.items()}
    print(f"{commands} replies, {account.seconds:.0f} s on the line: {faults}")
    print(account.stats)
    same = "the same in order" if account.expected == account.taken else "NOT the same"
    late = len(account.delivered) - len(account.taken)
    print(f"{len(account.expected)} good replies sent, {len(account.taken)} delivered, {same}; {late} late ones taken")


if __name__ == "__main__":
    main(*sys.argv[1:])
