#!/usr/bin/env python3
import unittest

import rospy
import rostest
from driver_load import load_of

# One turn: travel there and back over 5 m, 27 bytes out and 513 back at 115200 baud.
FASTEST_RATE = 1.0 / (2 * 5.0 / 1500.0 + (27 + 513) * 10 / 115200)


class TestLoad(unittest.TestCase):
    def test_at_the_fastest_rate_the_driver_is_quick_and_loses_nothing(self):
        load = load_of("imagenex_852_driver", rospy.get_param("~seconds"))
        told = f"{load.rate:.1f} pings/s (the line allows {FASTEST_RATE:.1f}), {load.share:.1f} % of a core"
        print(f"{told}, {load.health}")
        assert load.share <= 5.0
        assert load.rate > 0.9 * FASTEST_RATE
        assert load.has_every_beam
        lost = [load.health[count] for count in ("timeouts", "bad frames", "unexpected replies", "early replies")]
        assert lost == ["0", "0", "0", "0"]


if __name__ == "__main__":
    rospy.init_node("imagenex_852_load")
    rostest.rosrun("underwater_map_construction", "imagenex_852_load", TestLoad)
