"""How much of a processor a driver needs, and whether it loses beams."""

import os
import xmlrpc.client
from dataclasses import dataclass
from typing import Dict, List

import rosgraph
from driver_listener import beams, diagnostics, values

from underwater_map_construction.msg import SonarScanLine


@dataclass(frozen=True)
class DriverLoad:
    """rate: beams per second. share: percent of one processor. health: what the driver reports at the end."""

    rate: float
    share: float
    received: List[SonarScanLine]
    health: Dict[str, str]

    @property
    def has_every_beam(self) -> bool:
        """Whether the beams' numbers go on without a gap."""
        numbers = [beam.header.seq for beam in self.received]
        return numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def load_of(driver: str, seconds: float) -> DriverLoad:
    """Listen to a driver for `seconds` of its beams' stamps. Raises AssertionError where no beams come."""
    listener = beams()
    listener.wait_for_more(20)
    node = xmlrpc.client.ServerProxy(rosgraph.Master("/load").lookupNode(f"/{driver}"))
    pid = node.getPid("/load")[2]
    first, before = listener.received[-1].header, _cpu_seconds(pid)
    listener.wait(lambda received: (received[-1].header.stamp - first.stamp).to_sec() >= seconds, 2 * seconds + 5)
    last, after = listener.received[-1].header, _cpu_seconds(pid)
    span = (last.stamp - first.stamp).to_sec()
    health = values(diagnostics(driver).wait_for_more(1)[0])
    return DriverLoad((last.seq - first.seq) / span, 100 * (after - before) / span, listener.received, health)


def _cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has used so far."""
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
