#!/usr/bin/env python3
import unittest

import rospy
from driver_load import is_once
from graph import run

# One turn: travel there and back over 5 m, 27 bytes out and 513 back at 115200 baud.
FASTEST_RATE = 1.0 / (2 * 5.0 / 1500.0 + (27 + 513) * 10 / 115200)
LOSSES = ("timeouts", "bad frames", "unexpected replies", "early replies")


def is_quick(load):
    """Return whether the driver pings as fast as the line allows, and loses nothing."""
    told = f"{load.rate:.1f} pings/s (the line allows {FASTEST_RATE:.1f}), {load.share:.1f} % of a core"
    print(f"{told}, lost: {load.lost}, every beam: {load.has_every_beam}")
    return load.share <= 5.0 and load.rate > 0.9 * FASTEST_RATE and load.has_every_beam


class TestLoad(unittest.TestCase):
    def test_at_the_fastest_rate_the_driver_is_quick_and_loses_nothing(self):
        assert is_once(is_quick, "imagenex_852_driver", rospy.get_param("~seconds"), LOSSES)


if __name__ == "__main__":
    run(TestLoad)
