#!/usr/bin/env python3
"""The servo is stepped, the map gets a floor, and a service puts the sonar back to horizontal."""

import math
import unittest
from itertools import groupby

import numpy as np
import rospy
from graph import PATIENCE, Diagnostics, Inbox, rows, run
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, UInt32

from underwater_map_construction.msg import SonarScanLine
from underwater_map_construction.srv import SetScanMode

FLOOR = -5.5


def whole_scans(beams: Inbox) -> list:
    """Return the tilts at which a full turn was scanned, in whole degrees, in the order of time."""
    tilts = groupby(round(math.degrees(beam.sensorAngle), 1) for beam in beams.messages)
    return [round(degrees) for degrees, same in tilts if len(list(same)) >= 120]


def follow(wanted: list, found: list) -> bool:
    """Tell whether the wanted tilts stand one after the other among those found."""
    return any(found[start : start + len(wanted)] == wanted for start in range(len(found)))


class SonarControl(unittest.TestCase):
    """Watches one sweep."""

    def test_1_a_sweep_scans_every_tilt_whole_and_finds_the_floor(self) -> None:
        """A full turn at -20, 0 and 20 degrees."""
        beams, cloud = Inbox("/sonar/raw", SonarScanLine), Inbox("/MLSM/cloud", PointCloud2)
        commands = Inbox("/sonar_servo/command", Float64)
        Inbox("/sonar_control/sweeps", UInt32).wait_for()
        # The count of sweeps may overtake beams and commands: topics have no common order.
        beams.wait_for(lambda _: follow([-20, 0, 20], whole_scans(beams)))
        commands.wait_for(lambda _: follow([0, 20, 0], [round(math.degrees(one.data)) for one in commands.messages]))
        cloud.wait_for(lambda message: np.count_nonzero(np.abs(rows(message)[:, 2] - FLOOR) < 0.5) > 50)

    def test_2_a_mode_that_does_not_exist_is_refused(self) -> None:
        rospy.wait_for_service("/sonar_control/set_mode", PATIENCE)
        answer = rospy.ServiceProxy("/sonar_control/set_mode", SetScanMode)("VERTICAL")
        self.assertFalse(answer.success)
        self.assertIn("must be one of STATIC_MAPPING, HORIZONTAL", answer.message)

    def test_3_horizontal_puts_the_sonar_back_and_keeps_it_there(self) -> None:
        beams = Inbox("/sonar/raw", SonarScanLine)
        self.assertTrue(rospy.ServiceProxy("/sonar_control/set_mode", SetScanMode)("HORIZONTAL").success)
        self.assertEqual(rospy.get_param("/sonar_control/mode"), "HORIZONTAL")
        beams.wait_for(lambda beam: beam.sensorAngle == 0.0)
        Diagnostics().wait_for("sonar_control", "scans", 3)


if __name__ == "__main__":
    run(SonarControl)
