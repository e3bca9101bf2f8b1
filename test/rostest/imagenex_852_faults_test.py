#!/usr/bin/env python3
import os
import sys
import threading
import unittest

import rospy
from graph import run

_HERE = os.path.dirname(os.path.realpath(__file__))
sys.path.insert(0, os.path.join(_HERE, os.pardir, "unit", "imagenex_852_driver"))

from driver_listener import beams, diagnostics, values  # noqa: E402
from fault_experiment import GOOD, NumberedEchoes, RecordingInjector, fault_rates  # noqa: E402

from imagenex_852_driver.emulated_852 import Emulated852  # noqa: E402
from imagenex_852_driver.line.parameters import LineTiming  # noqa: E402
from sonar_driver.emulator.faults import Fault  # noqa: E402
from sonar_driver.emulator.head_server import HeadServer, PtyLine  # noqa: E402

_TIMING = LineTiming(baud_rate=1152000, speed_of_sound=15000.0)


class TestFaults(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.beams = beams()
        cls.beams.wait_for_publisher()
        out_of_commands = threading.Event()
        rates = fault_rates(rospy.get_param("~rate"), rospy.get_param("imagenex_852_driver/reply_margin"))
        cls.faults = RecordingInjector(rates, 0, rospy.get_param("~commands"), out_of_commands)
        head = Emulated852(NumberedEchoes(), cls.faults, _TIMING)
        with HeadServer(head, PtyLine(rospy.get_param("~port"))):
            assert out_of_commands.wait(rospy.get_param("~time_limit"))
            cls.expected = [number for number, fault in enumerate(cls.faults.of_pings) if fault in GOOD]
            cls.beams.wait(lambda received: len(received) >= len(cls.expected))
            cls.health = values(diagnostics().wait_for_more(2)[-1])
        cls.delivered = [int.from_bytes(bytes(beam.intensities[:4]), "big") for beam in cls.beams.received]
        print({fault.value: count for fault, count in cls.faults.counts.items()})
        print(cls.health)
        print(f"{len(cls.expected)} good replies sent, {len(cls.delivered)} published")

    def test_each_good_reply_is_published_once_and_in_order(self):
        assert self.expected == self.delivered

    def test_each_broken_reply_is_counted(self):
        counts = self.faults.counts
        assert int(self.health["bad frames"]) == counts[Fault.GARBLED] + counts[Fault.TRUNCATED]

    def test_each_late_or_doubled_reply_is_counted(self):
        counts = self.faults.counts
        assert int(self.health["unexpected replies"]) == counts[Fault.LATE] + counts[Fault.DOUBLED]

    def test_each_overrun_is_counted(self):
        assert int(self.health["overruns"]) == self.faults.counts[Fault.OVERRUN]

    def test_the_driver_is_connected_at_the_end(self):
        assert self.health["connected"] == "true"


if __name__ == "__main__":
    run(TestFaults)
