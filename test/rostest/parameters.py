#!/usr/bin/env python3
"""Bad parameters stop a node with one line, and are refused while it runs."""

import subprocess
import sys
import unittest

import rospy
import rostest
from dynamic_reconfigure.client import Client
from graph import PACKAGE, PATIENCE, Diagnostics


def start(node: str, parameter: str, name: str) -> "subprocess.CompletedProcess[str]":
    """Run a node that must end by itself."""
    command = ["rosrun", PACKAGE, node, f"__name:={name}", f"_{parameter}"]
    return subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE, check=False
    )


class Parameters(unittest.TestCase):
    """Start-up and run time."""

    def test_a_bad_value_stops_the_node_with_one_line(self) -> None:
        """The line names key, value and what is allowed."""
        done = start("thresholder", "otsu_multiplier:=-1.5", "bad_value")
        lines = [line for line in done.stdout.splitlines() if line.strip()]
        self.assertEqual(done.returncode, 1)
        self.assertEqual(len(lines), 1, done.stdout)
        self.assertIn("otsu_multiplier = -1.5: must be a number from 0 to 10", lines[0])

    def test_an_unknown_key_stops_the_node_with_one_line(self) -> None:
        """A key that is misspelled must not be ignored."""
        done = start("outlier_remover", "mean_kk:=20", "bad_key")
        self.assertEqual(done.returncode, 1)
        self.assertIn("mean_kk = 20: no such parameter", done.stdout)

    def test_a_bad_mode_stops_the_node_with_one_line(self) -> None:
        """Modes are a closed list."""
        done = start("sonar_to_cloud", "mode:=SONARLASER", "bad_mode")
        self.assertEqual(done.returncode, 1)
        self.assertIn("mode = 'SONARLASER': must be one of SONAR, LASER, SONARCONT, LASERCONT", done.stdout)

    def test_a_good_change_is_taken_while_running(self) -> None:
        """As dynparam or rqt_reconfigure send it."""
        client = Client("/thresholder", timeout=PATIENCE)
        self.assertEqual(client.update_configuration({"otsu_multiplier": 2.0})["otsu_multiplier"], 2.0)
        self.assertEqual(rospy.get_param("/thresholder/otsu_multiplier"), 2.0)
        client.close()

    def test_a_bad_change_is_refused_and_the_old_value_stays(self) -> None:
        """It is counted, and neither bent into the range nor stored."""
        diagnostics = Diagnostics()
        client = Client("/outlier_remover", timeout=PATIENCE)
        answer = client.update_configuration({"mode": "RADIUSES", "mean_k": 30})
        self.assertEqual((answer["mode"], answer["mean_k"]), ("STATISTICAL", 20))
        self.assertEqual(client.update_configuration({"min_radius": -3.0})["min_radius"], 1.0)
        self.assertEqual(rospy.get_param("/outlier_remover/min_radius"), 1.0)
        diagnostics.wait_for("outlier_remover", "changes of parameters refused", 2)
        client.close()


if __name__ == "__main__":
    rospy.init_node("parameters_test")
    rostest.rosrun(PACKAGE, "parameters", Parameters, sys.argv)
