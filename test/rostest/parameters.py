#!/usr/bin/env python3
"""Parameters that change while nodes run, and those of an older version."""

import signal
import subprocess
import unittest

import rospy
from dynamic_reconfigure.client import Client
from graph import PACKAGE, PATIENCE, Diagnostics, run, wait_until


class Parameters(unittest.TestCase):
    """Keys of older versions, and changes while nodes run."""

    def test_keys_of_an_older_version_are_named_in_one_warning_and_taken(self) -> None:
        """Also those that stand beside `expert` and not under it: the server then holds them where they belong."""
        keys = ("_kernel:=NUMBA", "_free_scans:=30", "_min_points:=20")
        command = ["rosrun", PACKAGE, "mlsm_core", "__name:=old_keys", *keys]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as node:
            wait_until(lambda: rospy.has_param("/old_keys/transform_tolerance"))
            held = rospy.get_param("/old_keys")
            node.send_signal(signal.SIGINT)
            told = [line for line in node.communicate(timeout=PATIENCE)[0].splitlines() if "an older version" in line]
        self.assertEqual(len(told), 1, told)
        self.assertIn("kernel -> nothing", told[0])
        self.assertIn("under expert belong free_scans, min_points", told[0])
        self.assertEqual((held["expert"]["free_scans"], held["expert"]["min_points"]), (30, 20))
        self.assertNotIn("min_points", held)

    def test_a_change_of_what_is_for_experts_is_held_where_the_node_reads_it(self) -> None:
        """Of parameters that have a key of their own."""
        client = Client("/mlsm_core", timeout=PATIENCE)
        client.update_configuration({"min_points": 21})
        self.assertEqual(rospy.get_param("/mlsm_core/expert/min_points"), 21)
        self.assertFalse(rospy.has_param("/mlsm_core/min_points"))
        client.close()

    def test_a_good_change_is_taken_while_running(self) -> None:
        """As dynparam or rqt_reconfigure send it."""
        client = Client("/thresholder", timeout=PATIENCE)
        self.assertEqual(client.update_configuration({"otsu_multiplier": 2.0})["otsu_multiplier"], 2.0)
        self.assertEqual(rospy.get_param("/thresholder/otsu_multiplier"), 2.0)
        client.close()

    def test_a_bad_change_is_refused_and_the_old_value_stays(self) -> None:
        """It is counted, and neither bent into the range nor stored."""
        diagnostics, refused = Diagnostics(), "changes of parameters refused"
        counted = diagnostics.known("outlier_remover", refused)
        client = Client("/outlier_remover", timeout=PATIENCE)
        answer = client.update_configuration({"mode": "RADIUSES", "mean_k": 30})
        self.assertEqual((answer["mode"], answer["mean_k"]), ("STATISTICAL", 20))
        self.assertEqual(client.update_configuration({"min_radius": -3.0})["min_radius"], 1.0)
        self.assertEqual(rospy.get_param("/outlier_remover/min_radius"), 1.0)
        diagnostics.wait_for("outlier_remover", refused, counted + 2)
        client.close()


if __name__ == "__main__":
    run(Parameters)
