#!/usr/bin/env python3
"""Every fault of an emulated head at once: what its driver publishes and counts. The argument is the sonar."""

import sys
import threading
import unittest
from typing import Any, Dict

import rospy
from driver_listener import beams, diagnostics, values
from graph import PACKAGE_ROOT, run

sys.path.insert(0, str(PACKAGE_ROOT / "test/unit/sonar_driver"))

from emulated_drivers import IMAGENEX_852, SONARS, RecordingInjector, served
from fault_experiment import fault_rates

from sonar_driver.emulator.faults import Fault

NAME = sys.argv[1]


class DriverFaults(unittest.TestCase):
    """On a fast line; a Ping360 scans by itself."""

    @classmethod
    def setUpClass(cls) -> None:
        sonar, published, out_of_commands = SONARS[NAME], beams(), threading.Event()
        published.wait_for_link()
        rates = fault_rates(sonar, rospy.get_param("~rate"), rospy.get_param(f"{NAME}_driver/reply_margin"))
        cls.faults = RecordingInjector(rates, 0, rospy.get_param("~commands"), out_of_commands)
        port = rospy.get_param("~port")
        head = sonar.emulated(sonar.connection_to(port), cls.faults)
        with served(sonar, port, head):
            assert out_of_commands.wait(rospy.get_param("~time_limit"))
            cls.expected = [number for number, fault in enumerate(cls.faults.of_pings) if fault in sonar.good]
            published.wait(lambda messages: len(messages) >= len(cls.expected))
            cls.health: Dict[str, Any] = values(diagnostics(f"{NAME}_driver").wait_for_more(2)[-1])
        cls.delivered = [int.from_bytes(bytes(beam.intensities[:4]), "big") for beam in published.messages]
        print({fault.value: count for fault, count in cls.faults.counts.items()})
        print(cls.health)
        print(f"{len(cls.expected)} good replies sent, {len(cls.delivered)} published")

    def test_each_good_reply_is_published_once_and_in_order(self) -> None:
        assert self.expected == self.delivered

    def test_each_bad_reply_is_counted(self) -> None:
        """A head that scans by itself does not wait: pieces of broken messages may look like one."""
        spoilt = self.count(Fault.GARBLED, Fault.TRUNCATED)
        if SONARS[NAME] is IMAGENEX_852:
            assert self.counted("bad frames") == spoilt
            assert self.counted("unexpected replies") == self.count(Fault.LATE, Fault.DOUBLED)
            assert self.counted("overruns") == self.count(Fault.OVERRUN)
        else:
            assert spoilt >= self.counted("bad frames") >= 0.9 * spoilt
            assert self.counted("unexpected replies") == self.count(Fault.DOUBLED)
            assert self.counted("refusals") == self.count(Fault.REFUSED)

    def test_the_driver_is_connected_at_the_end(self) -> None:
        assert self.health["connected"] == "true"

    def count(self, *faults: Fault) -> int:
        """Return how often the head had these faults."""
        return sum(self.faults.counts[fault] for fault in faults)

    def counted(self, what: str) -> int:
        """Return a count of the driver."""
        return int(self.health[what])


if __name__ == "__main__":
    run(DriverFaults)
