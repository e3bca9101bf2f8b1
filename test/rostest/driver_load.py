#!/usr/bin/env python3
"""How much of a processor a driver needs, and whether it loses beams. The argument is the sonar."""

import sys
import time
import unittest
from dataclasses import dataclass
from typing import Dict, List

import rospy
from graph import PACKAGE_ROOT, Diagnostics, Inbox, launch, process_of, run

from underwater_map_construction.msg import SonarScanLine

sys.path += [str(PACKAGE_ROOT / "test/unit/sonar_driver"), str(PACKAGE_ROOT / "scripts")]

from emulated_drivers import free_udp_port
from soaking.processes import held

# Another program may take the processor during one attempt.
ATTEMPTS = 8
# Steps of a loop, and how many s of processor time they take on the machine for which limits of shares are given.
STEPS, SECONDS = 1000000, 0.06
MOST_SHARE = 5.0
# One turn of the 852: travel there and back over 5 m, 27 bytes out and 513 back at 115200 baud.
FASTEST_RATE = 1.0 / (2 * 5.0 / 1500.0 + (27 + 513) * 10 / 115200)
# A turn of a real Ping360 at 2 m takes 9 s (manufacturer's specification).
REAL_RATE = 400 / 9.0
SONAR = sys.argv[1]
DRIVER = f"{SONAR}_driver"
# Counters that must not grow.
LOSSES = ("timeouts", "bad frames", "unexpected replies",
          {"imagenex_852": "early replies", "ping360": "missing beams"}[SONAR])  # fmt: skip


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

    def is_quick(self) -> bool:
        """Print the load, and return whether it is small and every beam is there."""
        told = f"{self.share:.1f} % of a core, lost: {self.lost}, every beam: {self.has_every_beam}"
        if SONAR == "imagenex_852":
            print(f"{self.rate:.1f} pings/s (the line allows {FASTEST_RATE:.1f}), {told}")
            return self.share <= MOST_SHARE and self.rate > 0.9 * FASTEST_RATE and self.has_every_beam
        print(f"{self.rate:.1f} beams/s, {10 * self.share / self.rate:.2f} ms per beam, {told}")
        is_whole = self.has_every_beam and len(self.received[-1].intensities) == 1200
        return self.rate > REAL_RATE and self.share * REAL_RATE / self.rate <= MOST_SHARE and is_whole


class Load(unittest.TestCase):
    """An 852 at its fastest rate, or a Ping360 that is faster than a real head."""

    def test_the_driver_is_quick_and_loses_nothing(self) -> None:
        if SONAR == "ping360":
            launch(self.addCleanup, "ping360_load.launch", f"port:={free_udp_port()}")
        self.assertTrue(any(_load_of(rospy.get_param("~seconds")).is_quick() for _ in range(ATTEMPTS)))


def _load_of(seconds: float) -> DriverLoad:
    """Return the load of so many seconds, by the stamps of the beams."""
    diagnostics, listener = Diagnostics(f"/{DRIVER}"), Inbox("sonar/raw", SonarScanLine)
    before = {loss: diagnostics.known(DRIVER, loss) for loss in LOSSES}
    listener.wait_for()
    start = len(listener.messages) - 1
    first, pid = listener.messages[start].header, process_of(f"/{DRIVER}")
    cpu_before = held(pid).cpu
    last = listener.wait_for(lambda beam: (beam.header.stamp - first.stamp).to_sec() >= seconds).header
    cpu, received = held(pid).cpu - cpu_before, listener.messages[start:]
    listener.close()
    diagnostics.forget()
    lost = {loss: diagnostics.known(DRIVER, loss) - number for loss, number in before.items()}
    span = (last.stamp - first.stamp).to_sec()
    return DriverLoad((last.seq - first.seq) / span, 100 * cpu / span / _slowness(), received, lost)


def _slowness() -> float:
    """Return how many times as long as on the machine of SECONDS a loop takes now, at least 1."""
    before, total = time.process_time(), 0
    for step in range(STEPS):
        total += step % 7
    return max((time.process_time() - before) / SECONDS, 1.0)


if __name__ == "__main__":
    run(Load)
