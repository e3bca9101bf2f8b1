#!/usr/bin/env python3
"""How much of a processor a driver needs, and whether it loses beams. The argument is the sonar."""

import sys
import time
import unittest
import xmlrpc.client
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Dict, List

import rosgraph
import rospy
from driver_listener import beams, diagnostics, values
from graph import PACKAGE_ROOT, launched, run

from underwater_map_construction.msg import SonarScanLine

sys.path += [str(PACKAGE_ROOT / "test/unit/sonar_driver"), str(PACKAGE_ROOT / "scripts")]

from emulated_drivers import free_udp_port
from soaking.processes import held

# Another program may take the processor during one attempt.
ATTEMPTS = 8
# Steps of a loop, and how many s of processor time they take on the machine for which limits of shares are given.
STEPS, SECONDS = 1000000, 0.06
# One turn of the 852: travel there and back over 5 m, 27 bytes out and 513 back at 115200 baud.
FASTEST_RATE = 1.0 / (2 * 5.0 / 1500.0 + (27 + 513) * 10 / 115200)
# A turn of a real Ping360 at 2 m takes 9 s (manufacturer's specification).
REAL_RATE = 400 / 9.0


SONAR = sys.argv[1]
# Counters that must not grow.
LOSSES = ("timeouts", "bad frames", "unexpected replies")
OWN_LOSS = {"imagenex_852": "early replies", "ping360": "missing beams"}


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


class Load(unittest.TestCase):
    """An 852 at its fastest rate, or a Ping360 that is faster than a real head."""

    def test_the_driver_is_quick_and_loses_nothing(self) -> None:
        with ExitStack() as running:
            if SONAR == "ping360":
                running.enter_context(launched("ping360_load.launch", f"port:={free_udp_port()}"))
            self.assertTrue(any(IS_QUICK[SONAR](_load_of(rospy.get_param("~seconds"))) for _ in range(ATTEMPTS)))


def _is_quick_852(load: DriverLoad) -> bool:
    print(f"{load.rate:.1f} pings/s (the line allows {FASTEST_RATE:.1f}), {load}")
    return load.share <= 5.0 and load.rate > 0.9 * FASTEST_RATE and load.has_every_beam


def _is_quick_360(load: DriverLoad) -> bool:
    print(f"{load.rate:.1f} beams/s, {10 * load.share / load.rate:.2f} ms per beam, {load}")
    is_whole = load.has_every_beam and len(load.received[-1].intensities) == 1200
    return load.rate > REAL_RATE and load.share * REAL_RATE / load.rate <= 5.0 and is_whole


IS_QUICK = {"imagenex_852": _is_quick_852, "ping360": _is_quick_360}


def _load_of(seconds: float) -> DriverLoad:
    """Return the load of so many seconds, by the stamps of the beams."""
    driver = f"{SONAR}_driver"
    health, listener = diagnostics(driver), beams()
    before = values(health.wait_for_more()[0])
    start = len(listener.messages)
    first = listener.wait_for_more(1)[0].header
    pid = _process(driver)
    cpu_before = held(pid).cpu
    listener.wait(lambda received: (received[-1].header.stamp - first.stamp).to_sec() >= seconds)
    last, cpu = listener.messages[-1].header, held(pid).cpu - cpu_before
    after = values(health.wait_for_more()[0])
    for one in (health, listener):
        one.close()
    span = (last.stamp - first.stamp).to_sec()
    lost = {key: int(after[key]) - int(before[key]) for key in (*LOSSES, OWN_LOSS[SONAR])}
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


if __name__ == "__main__":
    run(Load)
