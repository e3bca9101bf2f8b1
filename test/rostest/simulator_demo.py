#!/usr/bin/env python3
"""The demo's graph: nothing is warned of, and the simulated vehicle moves as its script says."""

import unittest
from typing import List

import numpy as np
from graph import LONG_PATIENCE, PACKAGE_ROOT, Diagnostics, Inbox, launched, run
from messages import stamps_and_places
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from std_msgs.msg import Float32
from visualization_msgs.msg import Marker, MarkerArray

TOUR = 110.0  # s of the script's 112 that truth and odometry tell of
ERROR = 0.02  # of the odometry: that of a DVL
# Times real time. At the first a stall of a tenth of a second is one of two, and may be warned of; slower then.
FACTORS = (20.0, 4.0, 1.0)
TRUE_STOPS = np.array([(5.2, 0.0), (5.2, 3.9), (-5.2, 3.9)])


class SimulatorDemo(unittest.TestCase):
    """One run, 112 s of simulated time."""

    def test_the_demo_runs_as_configured_and_without_a_warning(self) -> None:
        """Truth follows the script, odometry errs by its parameter, beams become a map, the world is shown."""
        warned = []
        for factor in FACTORS:
            warned.append(self.run_demo(factor))
            if not warned[-1]:
                return
        self.fail(f"warnings in every run: {warned}")

    def run_demo(self, factor: float) -> List[str]:
        """Return what was warned of until the end of the script, which the log tells, but for a slow machine."""
        logs = Inbox("/rosout", Log)
        truth, odometry = Inbox("/ground_truth", Odometry), Inbox("/odom", Odometry)
        world, markers = Inbox("/sonar_simulator/world", Marker), Inbox("/MLSM/Markers", MarkerArray)
        progress, diagnostics = Inbox("/sonar_simulator/progress", Float32), Diagnostics()
        arguments = (f"script:={PACKAGE_ROOT}/yaml/thesis_moves.yaml", f"odometry_error:={ERROR}")
        with launched("demo.launch", *arguments, f"real_time_factor:={factor}", "rviz:=false"):
            progress.wait_for(lambda message: message.data >= 1.0, LONG_PATIENCE)
            self.assertTrue(world.wait_for().points)
            self.assertTrue(markers.wait_for(lambda array: any(marker.points for marker in array.markers)))
            diagnostics.wait_for("sonar_to_cloud", "scans", 6)
            diagnostics.wait_for("sonar_simulator", "beams out", 800)
            self.assertTrue(logs.wait(lambda found: any("moves have ended after 112 s" in log.msg for log in found)))
        (stamps, true), (times, believed) = (stamps_and_places(inbox.messages) for inbox in (truth, odometry))
        stamps, where, there = np.intersect1d(stamps, times, return_indices=True)
        self.assertGreater(np.ptp(stamps), TOUR)
        np.testing.assert_allclose(true[where], (1.0 + ERROR) * believed[there], atol=1e-6)
        for stop in TRUE_STOPS:
            self.assertLess(np.linalg.norm(true - stop, axis=1).min(), 1e-6)
        for inbox in (truth, odometry, world, markers, progress, logs):
            inbox.close()
        warnings = [f"{log.name}: {log.msg}" for log in logs.messages if log.level >= Log.WARN]
        return [line for line in warnings if "the machine" not in line]


if __name__ == "__main__":
    run(SimulatorDemo)
