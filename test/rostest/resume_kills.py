#!/usr/bin/env python3
"""mlsm_core keeps its map, and the vehicle its place, over kills with -9 at random moments."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
import unittest
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Dict, List, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point
from graph import PACKAGE_ROOT, PATIENCE, Diagnostics, Inbox, publisher, rows, run, temporary_folder, wait_until
from messages import place, still_cloud, transform, variance
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

sys.path += [str(PACKAGE_ROOT / "test/unit"), str(PACKAGE_ROOT / "test/unit/mlsm_manager")]

from made_harbour import SONAR_IN_BASE, tour

from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.map_file import read_map
from node_support.geometry import cells_of
from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import cloud_to_message
from underwater_map_construction.msg import StampedIntensityCloud
from underwater_map_construction.srv import GetRegion

KILLS_PER_VEHICLE = 5
SCANS = 24
VEHICLES = 4
"""Vehicles at the same time."""
KEPT = 0.9
"""Share of the saved cells; scans that may still move are drawn anew, and floats of 32 bits fall into other cells."""
PERIOD = 0.3
"""s of wall time between saves."""
USED = ("scans matched", "scans not matched", "scans placed by odometry", "scans not used")
"""Counters, one of which counts each scan that the node is done with, unless it refuses it."""
LATEST_FIX = 20.0
"""s of wall time for a scan to be matched or counted; nothing tells of all that are refused."""
AHEAD = 1.5
"""s of odometry after a scan's end that are sent before the scan, more than the localiser waits for."""
AWAY = (2.0, 10.0)
"""s of the mission that pass while a node starts again, at least and at most."""
EXPECTED_SCANS = 3
"""So many scans are only searched near the place where the vehicle is expected."""
KNOWN, DEVIATIONS = 0.5, 3.0
"""A fix may be so many m and its own standard deviations beside the true place."""
OTHER_PARENT = ("sh", "-c", '"$@"; exit $?', "sh")
"""What a command begins with that another process than this one shall start, as another run of roslaunch would."""


@dataclass(frozen=True)
class Kill:
    """map_kept: share of the saved cells that the node holds when it was started again.

    unmatched: scans until the first fix. errors: of each fix until the next kill its distance from the true place, and
    what it says of that, m.
    """

    map_kept: float
    unmatched: int
    errors: List[Tuple[float, float]]

    @property
    def is_harmless(self) -> bool:
        """Whether neither the map nor the place was lost for another one."""
        return self.map_kept >= KEPT and all(error <= KNOWN + DEVIATIONS * told for error, told in self.errors)


class Core:
    """An mlsm_core in a namespace of its own. topics: those that it gets, with their types."""

    def __init__(self, namespace: str, folder: Path, parameters: Dict[str, Any], topics: Dict[str, type]) -> None:
        kept = {"map_directory": str(folder), "autosave_period": PERIOD}
        rospy.set_param(f"{namespace}/mlsm_core", {**parameters, **kept})
        self.file = folder / f"{namespace.strip('/')}.mlsm_core.autosave.mlsm"
        self._namespace, self._topics = namespace, topics

    def start(self, *starter: str) -> None:
        """Start it, and wait until it takes what is published, and answers."""
        names = [f"/{name}:={self._namespace}/{name}" for name in ("tf", "tf_static")]
        command = [*starter, str(PACKAGE_ROOT / "nodes/mlsm_core"), f"__ns:={self._namespace}", *names]
        self._node = subprocess.Popen(command, start_new_session=True)
        try:
            named = {name: f"{self._namespace}/{name}" for name in self._topics}
            self._publishers = {name: publisher(topic, self._topics[name]) for name, topic in named.items()}
            rospy.wait_for_service(f"{self._namespace}/mlsm_core/get_region", timeout=PATIENCE)
        except (AssertionError, rospy.ROSException):
            os.killpg(self._node.pid, signal.SIGKILL)
            raise

    def kill(self) -> None:
        """Kill it, and forget the links to it, which would look like those of the next one."""
        os.killpg(self._node.pid, signal.SIGKILL)
        self._node.wait()
        for one in self._publishers.values():
            one.unregister()

    def publish(self, topic: str, message: Any) -> None:
        """Publish on one of its topics."""
        self._publishers[topic].publish(message)

    def held_points(self) -> np.ndarray:
        """Return the points (n, fields) of the map that it holds."""
        region = rospy.ServiceProxy(f"{self._namespace}/mlsm_core/get_region", GetRegion)
        return rows(region(Point(-1e4, -1e4, -1e4), Point(1e4, 1e4, 1e4)).cloud)


class ResumedVehicle:
    """Sends odometry and scans in the order of time, as fast as they are taken, in a harbour of its own."""

    def __init__(self, namespace: str, folder: Path, seed: int) -> None:
        self._tour = tour(SCANS, direction=0.05, seed=seed)
        # Nodes refuse stamps that are far from the clock.
        self._shift = time.time() - self._tour.scans[0].start
        topics = {"sonar/scan/echoes": StampedIntensityCloud, "tf": TFMessage, "tf_static": TFMessage}
        self._core = Core(namespace, folder, {"free_scans": 8}, topics)
        self._fixes = Inbox(f"{namespace}/MLSM/odometry", Odometry)
        self._diagnostics = Diagnostics(f"{namespace}/mlsm_core")
        self._sent_until = self._tour.scans[0].start - 1.0

    def die_often(self, kills: int) -> List[Kill]:
        """Go through the tour in `kills` + 1 parts, and die between them; return what became of each kill.

        Raises MapFileError for a file that is not whole.
        """
        parts = np.array_split(np.arange(SCANS), kills + 1)
        first, *others = [[self._tour.scans[number] for number in part] for part in parts]
        found = []
        self._start()
        try:
            self._go(first)
            wait_until(self._core.file.exists)
            for part in others:
                threading.Event().wait(random.uniform(0.0, 2.0 * PERIOD))
                self._core.kill()
                self._diagnostics.forget()
                saved = read_map(self._core.file).shown
                self._start()
                kept = self._share_held(saved)
                self._sent_until += random.uniform(*AWAY)
                self._go(part)
                fixed, ends = self._fixed(), [scan.reference_time for scan in part]
                unmatched = next((number for number, end in enumerate(ends) if end in fixed), len(ends))
                found.append(Kill(kept, unmatched, [self._error(end, fixed[end]) for end in ends if end in fixed]))
        finally:
            self._core.kill()
        return found

    def _start(self) -> None:
        self._core.start()
        mount = transform("base_link", "sonar", self._shift, *SONAR_IN_BASE)
        self._core.publish("tf_static", TFMessage([mount]))
        self._scans_sent = 0

    def _share_held(self, saved: Any) -> float:
        cells = {tuple(cell) for cell in saved.cells.tolist()}
        held = cells_of(self._core.held_points().astype(np.float64), saved.resolution)
        return len(cells & {tuple(cell) for cell in held.tolist()}) / len(cells)

    def _go(self, part: List[Scan]) -> None:
        """Send scans; those that end while no node listens are lost."""
        for scan in part:
            if scan.reference_time + AHEAD > self._sent_until:
                self._send_odometry(scan.reference_time + AHEAD)
                self._core.publish("sonar/scan/echoes", self._cloud(scan))
                self._scans_sent += 1
                wait_until(partial(self._is_done_with, scan), LATEST_FIX, required=False)

    def _is_done_with(self, scan: Scan) -> bool:
        """Tell whether the node has matched a scan, or tells that it has used all that were sent to it."""
        counted = self._diagnostics.values("mlsm_core")
        used = sum(int(counted.get(key, 0)) for key in USED)
        return scan.reference_time in self._fixed() or used >= self._scans_sent

    def _cloud(self, scan: Scan) -> StampedIntensityCloud:
        stamps = np.where(scan.moving, 1.0, -1.0) * (scan.times + self._shift)
        end = rospy.Time.from_sec(scan.reference_time + self._shift)
        return cloud_to_message(Cloud(scan.points.astype(np.float32), stamps, end.to_nsec(), "odom"))

    def _send_odometry(self, until: float) -> None:
        track = self._tour.odometry
        first, last = np.searchsorted(track.times, [self._sent_until, until])
        known = zip(track.times[first:last], track.poses[first:last])
        poses = [transform("odom", "base_link", time + self._shift, *pose) for time, pose in known]
        self._core.publish("tf", TFMessage(poses))
        self._sent_until = until

    def _fixed(self) -> Dict[float, Odometry]:
        """Return all fixes by the end of their scan [s]."""
        ends = np.array([scan.reference_time for scan in self._tour.scans])
        stamps = [(fix.header.stamp.to_sec() - self._shift, fix) for fix in self._fixes.messages]
        return {float(ends[np.abs(ends - stamp).argmin()]): fix for stamp, fix in stamps}

    def _error(self, end: float, fix: Odometry) -> Tuple[float, float]:
        """Return how far a fix is from the true place, and what it says of that, m."""
        return float(np.hypot(*(place(fix) - self._tour.truth.at(np.array(end))[:2]))), float(np.sqrt(variance(fix)))


class ResumeKills(unittest.TestCase):
    """Vehicles are killed `~kills` times altogether."""

    def test_no_kill_loses_the_map_or_puts_the_vehicle_elsewhere(self) -> None:
        folder = temporary_folder(self.addCleanup)

        def kills_of(number: int) -> List[Kill]:
            return ResumedVehicle(f"/vehicle_{number}", folder, number).die_often(KILLS_PER_VEHICLE)

        with ThreadPoolExecutor(VEHICLES) as pool:
            vehicles = range(rospy.get_param("~kills") // KILLS_PER_VEHICLE)
            kills = list(chain.from_iterable(pool.map(kills_of, vehicles)))
        print(*kills, sep="\n", flush=True)
        self.assertEqual([kill for kill in kills if not kill.is_harmless], [])
        self.assertGreater(sum(kill.unmatched < EXPECTED_SCANS for kill in kills), len(kills) // 2)

    def test_a_node_that_another_process_starts_begins_a_new_map(self) -> None:
        folder = temporary_folder(self.addCleanup)
        parameters = {"start_matching": False, "map_input": "CLEANED"}
        core = Core("/vehicle_of_two", folder, parameters, {"sonar/scan/cleaned": StampedIntensityCloud})
        core.start()
        core.publish("sonar/scan/cleaned", still_cloud([[0.1, 0.1, -1.0, 50.0]]))
        wait_until(core.file.exists)
        core.kill()
        for starter, held in (((), 1), (OTHER_PARENT, 0)):
            core.start(*starter)
            self.assertEqual(len(core.held_points()), held)
            core.kill()
        self.assertEqual(len(list(folder.glob("*.autosave.previous.mlsm"))), 1)


if __name__ == "__main__":
    run(ResumeKills)
