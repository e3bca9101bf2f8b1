#!/usr/bin/env python3
"""How much of a processor a driver needs, and whether it loses beams. The argument is the sonar."""

import os
import socket
import sys
import time
import unittest
import xmlrpc.client
from dataclasses import dataclass
from typing import Callable, Dict, List, Sequence

import rosgraph
import rospy
from driver_listener import beams, diagnostics, values
from graph import launched, run

from underwater_map_construction.msg import SonarScanLine

# Another program may take the processor during one attempt.
ATTEMPTS = 4
# Steps of a loop, and how many s of processor time they take on the machine for which limits of shares are given.
STEPS, SECONDS = 1000000, 0.06
# One turn of the 852: travel there and back over 5 m, 27 bytes out and 513 back at 115200 baud.
FASTEST_RATE = 1.0 / (2 * 5.0 / 1500.0 + (27 + 513) * 10 / 115200)
# A turn of a real Ping360 at 2 m takes 9 s (manufacturer's specification).
REAL_RATE = 400 / 9.0


@dataclass(frozen=True)
class DriverLoad:
    """rate: beams per second. share: percent of a processor as fast as that of SECONDS.

    lost: what the driver counted in the meantime.
    """

    rate: float
    share: float
    received: List[SonarScanLine]
    lost: Dict[str, int]

    def __str__(self) -> str:
        return f"{self.share:.1f} % of a core, lost: {self.lost}, every beam: {self.has_every_beam}"

    @property
    def has_every_beam(self) -> bool:
        """Whether nothing was lost, and the beams' numbers go on without a gap."""
        numbers = [beam.header.seq for beam in self.received]
        return not any(self.lost.values()) and numbers == list(range(numbers[0], numbers[0] + len(numbers)))


class Imagenex852(unittest.TestCase):
    """At its fastest rate."""

    def test_the_driver_is_quick_and_loses_nothing(self) -> None:
        """It pings as fast as the line allows."""
        losses = ("timeouts", "bad frames", "unexpected replies", "early replies")
        self.assertTrue(is_once(self.is_quick, "imagenex_852_driver", losses))

    def is_quick(self, load: DriverLoad) -> bool:
        """Return whether a load is as it must be."""
        print(f"{load.rate:.1f} pings/s (the line allows {FASTEST_RATE:.1f}), {load}")
        return load.share <= 5.0 and load.rate > 0.9 * FASTEST_RATE and load.has_every_beam


class Ping360(unittest.TestCase):
    """Faster than a real head."""

    def test_the_driver_is_quick_and_loses_nothing(self) -> None:
        """It follows the head."""
        losses = ("timeouts", "bad frames", "missing beams", "unexpected replies")
        with launched("ping360_load.launch", f"port:=udp://127.0.0.1:{_free_port()}"):
            self.assertTrue(is_once(self.is_quick, "ping360_driver", losses))

    def is_quick(self, load: DriverLoad) -> bool:
        """Return whether a load is as it must be."""
        print(f"{load.rate:.1f} beams/s, {10 * load.share / load.rate:.2f} ms per beam, {load}")
        is_whole = load.has_every_beam and len(load.received[-1].intensities) == 1200
        return load.rate > REAL_RATE and load.share * REAL_RATE / load.rate <= 5.0 and is_whole


def is_once(is_quick: Callable[[DriverLoad], bool], driver: str, losses: Sequence[str]) -> bool:
    """Return whether a driver is quick in one of some attempts of ~seconds, by the stamps of its beams.

    losses: counters of the driver that must not grow. Raises AssertionError where no beams come.
    """
    return any(is_quick(_load_of(driver, rospy.get_param("~seconds"), losses)) for _ in range(ATTEMPTS))


def _free_port() -> int:
    """Return a UDP port of this computer that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _load_of(driver: str, seconds: float, losses: Sequence[str]) -> DriverLoad:
    health, listener = diagnostics(driver), beams()
    before = values(health.wait_for_more()[0])
    start = len(listener.messages)
    first = listener.wait_for_more(1)[0].header
    pid = _process(driver)
    cpu_before = _cpu_seconds(pid)
    listener.wait(lambda received: (received[-1].header.stamp - first.stamp).to_sec() >= seconds)
    last, cpu = listener.messages[-1].header, _cpu_seconds(pid) - cpu_before
    after = values(health.wait_for_more()[0])
    for one in (health, listener):
        one.close()
    span = (last.stamp - first.stamp).to_sec()
    lost = {key: int(after[key]) - int(before[key]) for key in losses}
    return DriverLoad((last.seq - first.seq) / span, 100 * cpu / span / _slowness(), listener.messages[start:], lost)


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


if __name__ == "__main__":
    run({"imagenex_852": Imagenex852, "ping360": Ping360}[sys.argv[1]])
