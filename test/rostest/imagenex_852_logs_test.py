#!/usr/bin/env python3
"""play_852 and record_852: what they publish, write and say."""

import math
import signal
import subprocess
import unittest

import rospy
from graph import PACKAGE_ROOT, Diagnostics, Inbox, ended, publisher, run, temporary_folder

from imagenex_852_driver.log_file import LoggedPing, LogReader, LogWriter
from imagenex_852_driver.reply import Reply, ReplyKind
from imagenex_852_driver.ros.nodes import reply_message
from underwater_map_construction.msg import SonarScanLine

# Each half a second and 3 deg after the one before.
PINGS = [
    LoggedPing(
        Reply(ReplyKind.IMX, 20, bytes([number] * 252), head_position=1400 + 20 * number),
        stamp=1447e6 + 0.5 * number,
        start_gain_db=7,
    )
    for number in range(10)
]


class TestLogs(unittest.TestCase):
    """With a log of ten pings."""

    def setUp(self):
        self.folder = temporary_folder(self.addCleanup)

    def test_play_publishes_every_ping_in_order_as_an_inverted_head_and_says_what_is_damaged(self):
        log, beams = self.folder / "made_up.852", Inbox("sonar/raw", SonarScanLine)
        self.addCleanup(beams.close)
        with LogWriter(log) as writer:
            for ping in PINGS:
                writer.write(ping)
        log.write_bytes(log.read_bytes()[:384] + b"noise" + log.read_bytes()[384:])
        command = [PACKAGE_ROOT / "nodes/play_852", log, "--rate", 200, "--wait-for-subscribers", "--inverted"]
        done = ended(list(map(str, command)))
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn("skipped 1 damaged parts: 5 damaged bytes at byte 384", done.stdout)
        received = beams.wait_for_number(len(PINGS))
        self.assertEqual([beam.intensities[0] for beam in received], list(range(10)))
        self.assertEqual({(beam.maxrange_meters, beam.gain) for beam in received}, {(20.0, 7)})
        self.assertAlmostEqual(received[1].angle, math.radians(3.0), places=5)

    def test_play_of_no_file_ends_with_one_line(self):
        done = ended([str(PACKAGE_ROOT / "nodes/play_852"), str(self.folder / "none.852")])
        self.assertEqual((done.returncode, len(done.stdout.splitlines())), (1, 1))
        self.assertIn("No such file", done.stdout)

    def test_record_writes_what_was_published(self):
        copy, diagnostics = self.folder / "copy.852", Diagnostics("/record_852")
        recorder = subprocess.Popen([str(PACKAGE_ROOT / "nodes/record_852"), str(copy)])
        self.addCleanup(recorder.wait)
        self.addCleanup(recorder.send_signal, signal.SIGINT)
        beams = publisher("sonar/raw", SonarScanLine)
        for ping in PINGS:
            message = reply_message(ping.reply, ping.start_gain_db, inverted=False)
            message.header.stamp = rospy.Time.from_sec(ping.stamp)
            beams.publish(message)
        diagnostics.wait_for("record_852", "pings written", len(PINGS))
        self.assertEqual(
            [(ping.reply, ping.stamp, ping.start_gain_db) for ping in LogReader(copy)],
            [(ping.reply, ping.stamp, ping.start_gain_db) for ping in PINGS],
        )
        beams.unregister()


if __name__ == "__main__":
    run(TestLogs)
