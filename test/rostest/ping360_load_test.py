#!/usr/bin/env python3
import socket
import unittest

import rospy
from driver_load import is_once
from graph import launched, run

# A turn of a real head at 2 m takes 9 s (manufacturer's specification).
REAL_RATE = 400 / 9.0
LOSSES = ("timeouts", "bad frames", "missing beams", "unexpected replies")


def is_quick(load):
    """Return whether the driver follows a head that is faster than a real one, and loses nothing."""
    per_beam = 10 * load.share / load.rate
    told = f"{load.rate:.1f} beams/s, {load.share:.1f} % of a core, {per_beam:.2f} ms per beam"
    print(f"{told}, lost: {load.lost}, every beam: {load.has_every_beam}")
    is_whole = load.has_every_beam and len(load.received[-1].intensities) == 1200
    return load.rate > REAL_RATE and load.share * REAL_RATE / load.rate <= 5.0 and is_whole


class TestLoad(unittest.TestCase):
    def test_faster_than_a_real_head_the_driver_is_quick_and_loses_nothing(self):
        with launched("ping360_load.launch", f"port:=udp://127.0.0.1:{_free_port()}"):
            assert is_once(is_quick, "ping360_driver", rospy.get_param("~seconds"), LOSSES)


def _free_port() -> int:
    """Return a UDP port of this computer that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


if __name__ == "__main__":
    run(TestLoad)
