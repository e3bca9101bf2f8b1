"""Drives an emulated head with every fault at a given rate and settles the accounts.

Command line: python3 fault_experiment.py [replies wanted] [rate of each fault]
"""

import os
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from typing import List

sys.path.append(os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "sonar_driver"))

from numbered_pings import NumberedEchoes, RecordingInjector

from imagenex_852_driver.emulator import Emulated852, FaultRates852
from imagenex_852_driver.line.connection import ConnectionParameters
from imagenex_852_driver.line.device import SonarDevice
from imagenex_852_driver.line.stats import DeviceStats
from imagenex_852_driver.protocol.settings import HeadSettings
from sonar_driver.emulator import Fault, HeadServer, PtyLine
from sonar_driver.line.scanner import Scanner

GOOD = (Fault.NONE, Fault.DOUBLED, Fault.OVERRUN)
# Beyond the longest wait for a reply.
LATENESS = 0.12
# Ten times the speed of wire and water.
FAST_LINE = {"baud_rate": 1152000, "speed_of_sound": 15000.0}


@dataclass(frozen=True)
class Account:
    """What the head did and what the driver made of it."""

    expected: List[int]
    delivered: List[int]
    faults: dict
    stats: DeviceStats
    seconds: float


def fault_rates(rate: float, reply_margin: float) -> FaultRates852:
    """Return `rate` for every fault; late replies come after the driver's wait, `reply_margin` s, is over."""
    names = ("dropped", "garbled", "truncated", "late", "doubled", "overrun", "silence", "disappearance")
    lasting = {"lateness": reply_margin + LATENESS, "silence_duration": 0.2, "absence_duration": 0.05}
    return FaultRates852(**dict.fromkeys(names, rate), **lasting)


def run(commands: int, rate: float, seed: int = 0, reply_margin: float = 0.08) -> Account:
    """Let the head see `commands` commands outside of silences; return the account."""
    stop = threading.Event()
    faults = RecordingInjector(fault_rates(rate, reply_margin), seed, commands, stop)
    delivered: List[int] = []
    with tempfile.TemporaryDirectory() as directory:
        connection = ConnectionParameters(
            port=f"{directory}/sonar",
            reply_margin=reply_margin,
            late_window=2 * LATENESS,
            byte_gap=reply_margin / 2,
            back_off_first=0.05,
            **FAST_LINE,
        )
        head = Emulated852(NumberedEchoes(), faults, connection.timing())
        device = SonarDevice(connection, stop)
        scanner = Scanner(
            device,
            HeadSettings(max_range=50).command(),
            lambda ping: delivered.append(int.from_bytes(ping.reply.echoes[:4], "big")),
        )
        begin = time.monotonic()
        with HeadServer(head, PtyLine(connection.port)):
            scanner.connect()
            scanner.run()
        seconds = time.monotonic() - begin
    expected = [number for number, fault in enumerate(faults.of_pings) if fault in GOOD]
    return Account(expected, delivered, dict(faults.counts), device.stats, seconds)


if __name__ == "__main__":
    account = run(int(sys.argv[1]) if len(sys.argv) > 1 else 10000, float(sys.argv[2]) if len(sys.argv) > 2 else 0.05)
    print({fault.value: count for fault, count in account.faults.items()})
    print(account.stats)
    print(f"{len(account.expected)} good replies sent, {len(account.delivered)} delivered,", end=" ")
    print("the same in order" if account.expected == account.delivered else "NOT the same", end=", ")
    print(f"{account.seconds:.0f} s")
