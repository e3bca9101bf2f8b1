#!/usr/bin/env python3
"""Every fault of an emulated head at once: what its driver publishes and counts. The argument is the sonar."""

import os
import sys
import threading
import unittest
from typing import Any, ClassVar, Dict, Tuple

import rospy
from driver_listener import beams, diagnostics, values
from graph import PACKAGE_ROOT, run

sys.path[:0] = [
    os.path.join(PACKAGE_ROOT, "test/unit", name) for name in ("imagenex_852_driver", "ping360_driver", "sonar_driver")
]

import fault_experiment  # noqa: E402
import ping360_fault_experiment  # noqa: E402
from numbered_pings import NumberedEchoes, RecordingInjector  # noqa: E402
from ping360_line import emulated, served_line  # noqa: E402

from imagenex_852_driver.emulated_852 import Emulated852  # noqa: E402
from imagenex_852_driver.line.parameters import LineTiming  # noqa: E402
from sonar_driver.emulator.emulated_head import EmulatedHead  # noqa: E402
from sonar_driver.emulator.faults import Fault, FaultRates  # noqa: E402
from sonar_driver.emulator.head_server import HeadServer  # noqa: E402


class DriverFaults:
    """Tests that a unittest.TestCase of one sonar inherits; `good`: faults whose replies are published."""

    sonar: ClassVar[str]
    good: ClassVar[Tuple[Fault, ...]]

    def rates(self, rate: float) -> FaultRates:
        """Return `rate` for every fault of the head."""
        raise NotImplementedError

    def head(self, port: str, faults: RecordingInjector) -> EmulatedHead:
        """Return the head."""
        raise NotImplementedError

    @classmethod
    def setUpClass(cls) -> None:
        """Serve the head until it has met all commands."""
        published, out_of_commands = beams(), threading.Event()
        published.wait_for_link()
        cls.faults = RecordingInjector(
            cls.rates(cls, rospy.get_param("~rate")), 0, rospy.get_param("~commands"), out_of_commands
        )
        port = rospy.get_param("~port")
        with HeadServer(cls.head(cls, port, cls.faults), served_line(port)):
            assert out_of_commands.wait(rospy.get_param("~time_limit"))
            cls.expected = [number for number, fault in enumerate(cls.faults.of_pings) if fault in cls.good]
            published.wait(lambda messages: len(messages) >= len(cls.expected))
            cls.health: Dict[str, Any] = values(diagnostics(f"{cls.sonar}_driver").wait_for_more(2)[-1])
        cls.delivered = [int.from_bytes(bytes(beam.intensities[:4]), "big") for beam in published.messages]
        print({fault.value: count for fault, count in cls.faults.counts.items()})
        print(cls.health)
        print(f"{len(cls.expected)} good replies sent, {len(cls.delivered)} published")

    def test_each_good_reply_is_published_once_and_in_order(self) -> None:
        """Whatever comes between them."""
        assert self.expected == self.delivered

    def count(self, *faults: Fault) -> int:
        """Return how often the head had these faults."""
        return sum(self.faults.counts[fault] for fault in faults)

    def counted(self, what: str) -> int:
        """Return a count of the driver."""
        return int(self.health[what])


class Imagenex852(DriverFaults, unittest.TestCase):
    """On a line ten times as fast as the real one."""

    sonar, good = "imagenex_852", fault_experiment.GOOD

    def rates(self, rate):
        return fault_experiment.fault_rates(rate, rospy.get_param("imagenex_852_driver/reply_margin"))

    def head(self, port, faults):
        return Emulated852(NumberedEchoes(), faults, LineTiming(baud_rate=1152000, speed_of_sound=15000.0))

    def test_each_bad_reply_is_counted(self):
        assert self.counted("bad frames") == self.count(Fault.GARBLED, Fault.TRUNCATED)
        assert self.counted("unexpected replies") == self.count(Fault.LATE, Fault.DOUBLED)
        assert self.counted("overruns") == self.count(Fault.OVERRUN)

    def test_the_driver_is_connected_at_the_end(self):
        assert self.health["connected"] == "true"


class Ping360(DriverFaults, unittest.TestCase):
    """While the head scans by itself."""

    sonar, good = "ping360", (Fault.NONE, Fault.DOUBLED, Fault.LATE)

    def rates(self, rate):
        return ping360_fault_experiment.fault_rates(rate)

    def head(self, port, faults):
        return emulated(port, faults)

    def test_each_bad_reply_is_counted(self):
        spoilt = self.count(Fault.GARBLED, Fault.TRUNCATED)
        assert spoilt >= self.counted("bad frames") >= 0.9 * spoilt
        assert self.counted("unexpected replies") == self.count(Fault.DOUBLED)
        assert self.counted("refusals") == self.count(Fault.REFUSED)


if __name__ == "__main__":
    run({"imagenex_852": Imagenex852, "ping360": Ping360}[sys.argv[1]])
