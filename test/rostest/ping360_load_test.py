#!/usr/bin/env python3
import socket
import unittest

import rospy
import rostest
from driver_load import load_of
from graph import launched

# A turn of a real head at 2 m takes 9 s (manufacturer's specification).
REAL_RATE = 400 / 9.0


class TestLoad(unittest.TestCase):
    def test_faster_than_a_real_head_the_driver_is_quick_and_loses_nothing(self):
        with launched("ping360_load.launch", f"port:=udp://127.0.0.1:{_free_port()}"):
            load = load_of("ping360_driver", rospy.get_param("~seconds"))
        per_beam = 10 * load.share / load.rate
        print(f"{load.rate:.1f} beams/s, {load.share:.1f} % of a core, {per_beam:.2f} ms per beam, {load.health}")
        assert load.rate > REAL_RATE
        assert load.share * REAL_RATE / load.rate <= 5.0
        assert len(load.received[-1].intensities) == 1200
        assert load.has_every_beam
        lost = [load.health[count] for count in ("timeouts", "bad frames", "missing beams", "unexpected replies")]
        assert lost == ["0", "0", "0", "0"]


def _free_port() -> int:
    """Return a UDP port of this computer that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


if __name__ == "__main__":
    rospy.init_node("ping360_load")
    rostest.rosrun("underwater_map_construction", "ping360_load", TestLoad)
