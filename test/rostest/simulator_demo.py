#!/usr/bin/env python3
"""The demo's graph: the simulated vehicle really moves 1.3 times what its odometry says."""

import unittest

import numpy as np
from graph import LONG_PATIENCE, PACKAGE_ROOT, Diagnostics, Inbox, launched, run
from messages import stamps_and_places
from nav_msgs.msg import Odometry
from std_msgs.msg import Float32
from visualization_msgs.msg import Marker, MarkerArray

TOUR = 110.0  # s of the script's 112 that truth and odometry tell of
TRUE_STOPS = np.array([(5.2, 0.0), (5.2, 3.9), (-5.2, 3.9)])


class SimulatorDemo(unittest.TestCase):
    """One run, 112 s of simulated time."""

    def test_the_demo_runs_as_configured(self) -> None:
        """Truth follows the script, odometry errs by its parameter, beams become a map, the world is shown."""
        truth, odometry = Inbox("/ground_truth", Odometry), Inbox("/odom", Odometry)
        world, markers = Inbox("/sonar_simulator/world", Marker), Inbox("/MLSM/Markers", MarkerArray)
        progress, diagnostics = Inbox("/sonar_simulator/progress", Float32), Diagnostics()
        arguments = (f"script:={PACKAGE_ROOT}/yaml/thesis_moves.yaml", "odometry_error:=0.3", "real_time_factor:=20.0")
        with launched("demo.launch", *arguments, "rviz:=false"):
            progress.wait_for(lambda message: message.data >= 1.0, LONG_PATIENCE)
            self.assertTrue(world.wait_for().points)
            self.assertTrue(markers.wait_for(lambda array: any(marker.points for marker in array.markers)))
            diagnostics.wait_for("sonar_to_cloud", "scans", 6)
            diagnostics.wait_for("sonar_simulator", "beams out", 800)
        (stamps, true), (times, believed) = (stamps_and_places(inbox.messages) for inbox in (truth, odometry))
        stamps, where, there = np.intersect1d(stamps, times, return_indices=True)
        self.assertGreater(np.ptp(stamps), TOUR)
        np.testing.assert_allclose(true[where], 1.3 * believed[there], atol=1e-6)
        for stop in TRUE_STOPS:
            self.assertLess(np.linalg.norm(true - stop, axis=1).min(), 1e-6)


if __name__ == "__main__":
    run(SimulatorDemo)
