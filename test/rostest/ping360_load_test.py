#!/usr/bin/env python3
import unittest
import xmlrpc.client

import rosgraph
import rospy
import rostest
from driver_listener import beams, diagnostics, values
from imagenex_852_load_test import cpu_seconds

# A turn of a real head at 2 m takes 9 s (manufacturer's specification).
REAL_RATE = 400 / 9.0


class TestLoad(unittest.TestCase):
    def test_faster_than_a_real_head_the_driver_is_quick_and_loses_nothing(self):
        seconds = rospy.get_param("~seconds")
        listener = beams()
        listener.wait_for_more(20)
        node = xmlrpc.client.ServerProxy(rosgraph.Master("/load").lookupNode("/ping360_driver"))
        pid = node.getPid("/load")[2]
        first, before = listener.received[-1].header, cpu_seconds(pid)
        listener.wait(lambda received: (received[-1].header.stamp - first.stamp).to_sec() >= seconds, 2 * seconds + 5)
        last, after = listener.received[-1].header, cpu_seconds(pid)
        span = (last.stamp - first.stamp).to_sec()
        rate, share = (last.seq - first.seq) / span, 100 * (after - before) / span
        health = values(diagnostics("ping360_driver").wait_for_more(1)[0])
        print(f"{rate:.1f} beams/s, {share:.1f} % of a core, {10 * share / rate:.2f} ms per beam, {health}")
        assert rate > REAL_RATE
        assert share * REAL_RATE / rate <= 5.0
        assert len(listener.received[-1].intensities) == 1200
        sequence = [beam.header.seq for beam in listener.received]
        assert sequence == list(range(sequence[0], sequence[0] + len(sequence)))
        lost = [health[count] for count in ("timeouts", "bad frames", "missing beams", "unexpected replies")]
        assert lost == ["0", "0", "0", "0"]


if __name__ == "__main__":
    rospy.init_node("ping360_load")
    rostest.rosrun("underwater_map_construction", "ping360_load", TestLoad)
