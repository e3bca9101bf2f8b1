"""How much of a processor a driver needs, and whether it loses beams."""

import os
import time
import xmlrpc.client
from dataclasses import dataclass
from typing import Callable, Dict, List, Sequence

import rosgraph
from driver_listener import beams, diagnostics, values

from underwater_map_construction.msg import SonarScanLine

# Another program may take the processor during one attempt.
ATTEMPTS = 4
# Steps of a loop, and how many s of processor time they take on the machine for which limits of shares are given.
STEPS, SECONDS = 1000000, 0.06


@dataclass(frozen=True)
class DriverLoad:
    """rate: beams per second. share: percent of a processor as fast as that of SECONDS.

    lost: what the driver counted in the meantime.
    """

    rate: float
    share: float
    received: List[SonarScanLine]
    lost: Dict[str, int]

    @property
    def has_every_beam(self) -> bool:
        """Whether nothing was lost, and the beams' numbers go on without a gap."""
        numbers = [beam.header.seq for beam in self.received]
        return not any(self.lost.values()) and numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def is_once(is_quick: Callable[[DriverLoad], bool], driver: str, seconds: float, losses: Sequence[str]) -> bool:
    """Return whether a driver is quick in one of some attempts of `seconds`, by the stamps of its beams.

    losses: counters of the driver that must not grow. Raises AssertionError where no beams come.
    """
    return any(is_quick(_load_of(driver, seconds, losses)) for _ in range(ATTEMPTS))


def _load_of(driver: str, seconds: float, losses: Sequence[str]) -> DriverLoad:
    health, listener = diagnostics(driver), beams()
    before = values(health.wait_for_more()[0])
    start = len(listener.received)
    first = listener.wait_for_more(1)[0].header
    pid = _process(driver)
    cpu_before = _cpu_seconds(pid)
    listener.wait(lambda received: (received[-1].header.stamp - first.stamp).to_sec() >= seconds)
    last, cpu = listener.received[-1].header, _cpu_seconds(pid) - cpu_before
    after = values(health.wait_for_more()[0])
    for one in (health, listener):
        one.close()
    span = (last.stamp - first.stamp).to_sec()
    lost = {key: int(after[key]) - int(before[key]) for key in losses}
    return DriverLoad((last.seq - first.seq) / span, 100 * cpu / span / _slowness(), listener.received[start:], lost)


def _process(driver: str) -> int:
    node = xmlrpc.client.ServerProxy(rosgraph.Master("/load").lookupNode(f"/{driver}"))
    return node.getPid("/load")[2]


def _slowness() -> float:
    """Return how many times as long as on the machine of SECONDS a loop takes now, at least 1."""
    before, total = time.process_time(), 0
    for step in range(STEPS):
        total += step % 7
    return max((time.process_time() - before) / SECONDS, 1.0)


def _cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has used so far."""
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
