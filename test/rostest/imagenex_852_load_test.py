#!/usr/bin/env python3
import os
import unittest
import xmlrpc.client

import rosgraph
import rospy
import rostest
from driver_listener import beams, diagnostics, values

NAME = "/imagenex_852_driver"
# One turn: travel there and back over 5 m, 27 bytes out and 513 back at 115200 baud.
FASTEST_RATE = 1.0 / (2 * 5.0 / 1500.0 + (27 + 513) * 10 / 115200)


def cpu_seconds(pid):
    """Return the processor time that a process has used so far."""
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class TestLoad(unittest.TestCase):
    def test_at_the_fastest_rate_the_driver_is_quick_and_loses_nothing(self):
        seconds = rospy.get_param("~seconds")
        listener = beams()
        listener.wait_for_more(20)
        node = xmlrpc.client.ServerProxy(rosgraph.Master("/load").lookupNode(NAME))
        pid = node.getPid("/load")[2]
        first, before = listener.received[-1].header, cpu_seconds(pid)
        listener.wait(lambda received: (received[-1].header.stamp - first.stamp).to_sec() >= seconds, 2 * seconds + 5)
        last, after = listener.received[-1].header, cpu_seconds(pid)
        span = (last.stamp - first.stamp).to_sec()
        rate, share = (last.seq - first.seq) / span, 100 * (after - before) / span
        health = values(diagnostics().wait_for_more(1)[0])
        print(f"{rate:.1f} pings/s (the line allows {FASTEST_RATE:.1f}), {share:.1f} % of a core, {health}")
        assert share <= 5.0
        assert rate > 0.9 * FASTEST_RATE
        sequence = [beam.header.seq for beam in listener.received]
        assert sequence == list(range(sequence[0], sequence[0] + len(sequence)))
        lost = [health[count] for count in ("timeouts", "bad frames", "unexpected replies", "early replies")]
        assert lost == ["0", "0", "0", "0"]


if __name__ == "__main__":
    rospy.init_node("imagenex_852_load")
    rostest.rosrun("underwater_map_construction", "imagenex_852_load", TestLoad)
