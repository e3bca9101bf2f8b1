#!/usr/bin/env python3
"""A node that follows a real vehicle with the joint solver goes on in its place after each kill -9."""

import random
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest
from pathlib import Path

import numpy as np
import rosbag
import rospy
import rostest
from graph import Inbox, play, recording, wait_until
from marina import nearest, planar, replayed, stamp
from nav_msgs.msg import Odometry

from mlsm_manager.surface_map.files.map_file import read_map

PERIOD = 2.0
"""s between saves, of the bag's time: several for each scan of 14 s."""
SAME_PLACE = 2.0
"""m: a scan or two are missing after each kill, so that the fixes are not those of a run without kills."""


class MarinaKills(unittest.TestCase):
    """The node is killed `~kills` times while a marina is played at `~rate`; map_bag's run tells where it must be."""

    def setUp(self) -> None:
        """Make a folder for the maps, start the node and map the recording without kills."""
        self.bag = recording("marina_first.bag")
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, str(self.folder))
        rospy.set_param("/mlsm_core/map_directory", str(self.folder))
        rospy.set_param("/mlsm_core/autosave_period", PERIOD)
        self.fixes = Inbox("/MLSM/odometry", Odometry)
        self.whole = replayed(self.bag)
        self.node = self._started()

    def test_the_vehicle_keeps_its_place_and_its_map(self) -> None:
        """After each kill the next fix is where map_bag has the vehicle, and the map ends as large as map_bag's."""
        player = threading.Thread(target=play, args=(self.bag, rospy.get_param("~rate"), 900.0))
        player.start()
        back = [self._killed(pause) for pause in self._pauses()]
        player.join()
        expected = [(one.scan.reference_time, one.result.pose) for one in self.whole.updates if one.result is not None]
        errors = {time: np.hypot(*(pose - nearest(expected, time))[:2]) for time, pose in self._poses()}
        first = [min((time for time in errors if time > killed), default=None) for killed in back]
        waited = [np.inf if time is None else time - killed for time, killed in zip(first, back)]
        print(
            f"kills {len(back)}; fixes {len(errors)} of {len(expected)}; largest distance {max(errors.values()):.2f} m"
        )
        print(f"first fix after a kill: {np.median(waited):.0f} s later in the median, {max(waited):.0f} s at most")
        print(f"its distance: {[round(float(errors[time]), 2) for time in first if time is not None]} m")
        self.assertLess(max(waited), np.inf)
        self.assertLess(max(errors.values()), SAME_PLACE)
        self._assert_map_is_whole()

    def _pauses(self) -> list:
        """Return the seconds of wall time before each kill; they end before the recording does."""
        kills = rospy.get_param("~kills")
        with rosbag.Bag(str(self.bag)) as bag:
            seconds = (bag.get_end_time() - bag.get_start_time()) / rospy.get_param("~rate")
        return [random.uniform(0.4, 1.4) * seconds / (kills + 3) for _ in range(kills)]

    def _killed(self, pause: float) -> float:
        """Kill the node after `pause` s of wall time, start it again, and return the bag's time [s] of the kill."""
        threading.Event().wait(pause)
        self.node.kill()
        self.node.wait()
        killed = rospy.get_time()
        for path in self.folder.glob("*.mlsm"):
            self.assertGreater(len(read_map(path)), 0)
        self.node = self._started()
        return killed

    def _started(self) -> subprocess.Popen:
        node = subprocess.Popen(["rosrun", "underwater_map_construction", "mlsm_core"], start_new_session=True)
        self.addCleanup(lambda: node.poll() is None and node.kill())
        return node

    def _poses(self) -> list:
        fixes = self.fixes.messages
        return [(stamp(fix), planar(fix.pose.pose.position, fix.pose.pose.orientation)) for fix in fixes]

    def _assert_map_is_whole(self) -> None:
        """The newest save has most cells of map_bag's map: it lacks the scans that came during restarts."""
        self.node.terminate()
        wait_until(lambda: self.node.poll() is not None)
        (path,) = self.folder.glob("*.autosave.mlsm")
        held = {tuple(cell) for cell in read_map(path).shown.cells.tolist()}
        wanted = {tuple(cell) for cell in self.whole.mapper.blocks.cells.tolist()}
        print(f"cells of map_bag's map that it holds: {100 * len(held & wanted) / len(wanted):.0f} %")
        self.assertGreater(len(held & wanted), 0.5 * len(wanted))


if __name__ == "__main__":
    rospy.init_node("marina_kills")
    rostest.rosrun("underwater_map_construction", "marina_kills", MarinaKills, sys.argv)
