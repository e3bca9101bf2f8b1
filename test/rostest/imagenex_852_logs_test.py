#!/usr/bin/env python3
import math
import signal
import subprocess
import unittest

import rospy
from driver_listener import beams, diagnostics, values
from graph import ended, run, temporary_folder

from imagenex_852_driver.log_file import LoggedPing, LogReader, LogWriter
from imagenex_852_driver.reply import Reply, ReplyKind
from imagenex_852_driver.ros.nodes import reply_message
from underwater_map_construction.msg import SonarScanLine

PACKAGE = "underwater_map_construction"
START = 1447000000.0


def tool(name, *arguments):
    """Return the command that runs one of the tools."""
    return ["rosrun", PACKAGE, name, *map(str, arguments)]


def logged(index):
    """Return ping number `index` of a made-up log: half a second and 3 deg after the one before."""
    reply = Reply(ReplyKind.IMX, 20, bytes([index] * 252), head_position=1400 + 20 * index)
    return LoggedPing(reply, stamp=START + 0.5 * index, start_gain_db=7)


class TestLogs(unittest.TestCase):
    def setUp(self):
        self.folder = temporary_folder(self)
        self.log = self.folder / "made_up.852"
        with LogWriter(self.log) as writer:
            for index in range(10):
                writer.write(logged(index))

    def play(self, path, *options):
        """Return the beams that play_852 publishes, and what it prints."""
        listener = beams()
        self.addCleanup(listener.close)
        done = ended(tool("play_852", path, "--rate", 200, "--wait-for-subscribers", *options))
        assert done.returncode == 0, done.stdout
        published = int(done.stdout.split(" beams published")[0].split()[-1])
        assert listener.wait(lambda received: len(received) >= published)
        return listener.messages, done.stdout

    def test_play_publishes_every_ping_in_order(self):
        received, _ = self.play(self.log)
        assert [beam.intensities[0] for beam in received] == list(range(10))
        assert {(beam.maxrange_meters, beam.gain) for beam in received} == {(20.0, 7)}

    def test_play_turns_the_angles_of_an_inverted_head(self):
        received, _ = self.play(self.log, "--inverted")
        assert abs(received[1].angle - math.radians(3.0)) < 1e-5

    def test_play_says_what_is_damaged(self):
        data = self.log.read_bytes()
        self.log.write_bytes(data[:384] + b"noise" + data[384:])
        received, text = self.play(self.log)
        assert len(received) == 10
        assert "skipped 1 damaged parts: 5 damaged bytes at byte 384" in text

    def test_play_of_no_file_ends_with_one_line(self):
        done = ended(tool("play_852", self.folder / "none.852"))
        assert (done.returncode, len(done.stdout.splitlines())) == (1, 1)
        assert "No such file" in done.stdout

    def test_record_writes_what_was_published(self):
        copy = self.folder / "copy.852"
        health = diagnostics("record_852")
        recorder = subprocess.Popen(tool("record_852", copy))
        self.addCleanup(recorder.wait)
        self.addCleanup(recorder.send_signal, signal.SIGINT)
        publisher = rospy.Publisher("sonar/raw", SonarScanLine, queue_size=100)
        sent = [reply_message(logged(index).reply, 7, inverted=False) for index in range(10)]
        for index, message in enumerate(sent):
            message.header.stamp = rospy.Time.from_sec(logged(index).stamp)
        while not publisher.get_num_connections():
            rospy.rostime.wallsleep(0.01)
        for message in sent:
            publisher.publish(message)
        assert health.wait(lambda arrays: arrays and values(arrays[-1]).get("pings written") == "10")
        for made, written in zip(map(logged, range(10)), LogReader(copy)):
            assert (written.reply, written.stamp) == (made.reply, made.stamp)
            assert written.start_gain_db == 7
        publisher.unregister()


if __name__ == "__main__":
    run(TestLogs)
