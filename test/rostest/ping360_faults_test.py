#!/usr/bin/env python3
import os
import sys
import threading
import unittest

import rospy
from graph import run

_HERE = os.path.dirname(os.path.realpath(__file__))
sys.path[:0] = [os.path.join(_HERE, os.pardir, "unit", name) for name in ("ping360_driver", "sonar_driver")]

from driver_listener import beams, diagnostics, values  # noqa: E402
from numbered_pings import RecordingInjector  # noqa: E402
from ping360_fault_experiment import fault_rates  # noqa: E402
from ping360_line import emulated, served_line  # noqa: E402

from sonar_driver.emulator.faults import Fault  # noqa: E402
from sonar_driver.emulator.head_server import HeadServer  # noqa: E402

_GOOD = (Fault.NONE, Fault.DOUBLED, Fault.LATE)


class TestFaults(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.beams = beams()
        cls.beams.wait_for_publisher()
        out_of_commands = threading.Event()
        rates = fault_rates(rospy.get_param("~rate"))
        cls.faults = RecordingInjector(rates, 0, rospy.get_param("~commands"), out_of_commands)
        port = rospy.get_param("~port")
        with HeadServer(emulated(port, cls.faults), served_line(port)):
            assert out_of_commands.wait(rospy.get_param("~time_limit"))
            cls.expected = [number for number, fault in enumerate(cls.faults.of_pings) if fault in _GOOD]
            cls.beams.wait(lambda received: len(received) >= len(cls.expected))
            cls.health = values(diagnostics("ping360_driver").wait_for_more(2)[-1])
        cls.delivered = [int.from_bytes(bytes(beam.intensities[:4]), "big") for beam in cls.beams.received]
        print({fault.value: count for fault, count in cls.faults.counts.items()})
        print(cls.health)
        print(f"{len(cls.expected)} good replies sent, {len(cls.delivered)} published")

    def test_each_good_reply_is_published_once_and_in_order(self):
        assert self.expected == self.delivered

    def test_broken_replies_are_counted(self):
        spoilt = self.faults.counts[Fault.GARBLED] + self.faults.counts[Fault.TRUNCATED]
        assert spoilt >= int(self.health["bad frames"]) >= 0.9 * spoilt

    def test_each_doubled_reply_is_counted(self):
        assert int(self.health["unexpected replies"]) == self.faults.counts[Fault.DOUBLED]

    def test_each_refusal_is_counted(self):
        assert int(self.health["refusals"]) == self.faults.counts[Fault.REFUSED]


if __name__ == "__main__":
    run(TestFaults)
