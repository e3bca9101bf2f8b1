"""A vehicle whose mlsm_core is killed with -9 again and again, and how its node went on each time."""

import random
import subprocess
import threading
import time
from dataclasses import dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, Dict, List, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point
from graph import PACKAGE_ROOT, PATIENCE, Diagnostics, Inbox, forget_links, rows, wait_for_publisher_links, wait_until
from messages import transform
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from mlsm_manager.localisation.resumption import StoredPlace
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.surface_map.blocks import cells_of
from mlsm_manager.surface_map.map_file import read_map
from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import cloud_to_message
from underwater_map_construction.msg import StampedIntensityCloud
from underwater_map_construction.srv import GetRegion

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
ROUNDING = 1e-3
"""s, more than is lost of a time since 1970."""
EXPECTED_SCANS = 3
"""So many scans are only searched near the place where the vehicle is expected."""
DEVIATIONS = 3.0
"""A fix may be so many of its own standard deviations beside the wanted place."""


class Fate(Enum):
    """What became of a vehicle's place after a kill."""

    GOES_ON = "goes on"
    FOUND_AGAIN = "found again"
    WRONG = "wrong"
    NOT_FOUND = "not found before the next kill"


@dataclass(frozen=True)
class Kill:
    """map_kept: share of the saved cells that the node holds when it was started again.
    seconds_lost: of wall time, from the first fix that was not saved to the kill; 0 where all were saved.

    distance, deviation: m, of the fix that is farthest from the wanted place, and what it says of itself.
    """

    map_kept: float
    seconds_lost: float
    fate: Fate
    distance: float
    deviation: float


@dataclass(frozen=True)
class Mission:
    """scans, odometry: of the whole mission. wanted: the path that should be found, T_map_base, known to `tolerance` m.

    parameters: of mlsm_core. sonar_in_base: (2,) m.
    """

    scans: Sequence[Scan]
    odometry: Track
    wanted: Track
    tolerance: float
    parameters: Dict[str, Any]
    sonar_in_base: np.ndarray


def started_core(
    namespace: str, publishers: Sequence[rospy.Publisher], starter: Sequence[str] = (), names: Sequence[str] = ()
) -> "subprocess.Popen[bytes]":
    """Start mlsm_core in a namespace, and wait until it takes what `publishers` send, and answers.

    starter: what the command begins with. names: remapped ones.
    """
    command = [*starter, str(PACKAGE_ROOT / "nodes/mlsm_core"), f"__ns:={namespace}", *names]
    node = subprocess.Popen(command, start_new_session=True)
    try:
        for publisher in publishers:
            wait_for_publisher_links(publisher, 1)
        rospy.wait_for_service(f"{namespace}/mlsm_core/get_region", timeout=PATIENCE)
    except (AssertionError, rospy.ROSException):
        node.kill()
        raise
    return node


def held_points(namespace: str) -> np.ndarray:
    """Return the points (n, fields) of the map that a node holds."""
    region = rospy.ServiceProxy(f"{namespace}/mlsm_core/get_region", GetRegion)
    return rows(region(Point(-1e4, -1e4, -1e4), Point(1e4, 1e4, 1e4)).cloud)


class ResumedVehicle:
    """Sends odometry and scans in the order of time, as fast as they are taken, to a node in a namespace of its own."""

    def __init__(self, namespace: str, folder: Path, mission: Mission) -> None:
        self._mission, self._namespace = mission, namespace
        # Nodes refuse stamps that are far from the clock.
        self._shift = time.time() - mission.scans[0].start
        self._file = folder / f"{namespace.strip('/')}.mlsm_core.autosave.mlsm"
        parameters = {**mission.parameters, "map_directory": str(folder), "autosave_period": PERIOD}
        rospy.set_param(f"{namespace}/mlsm_core", parameters)
        self._echoes = rospy.Publisher(f"{namespace}/sonar/scan/echoes", StampedIntensityCloud, queue_size=10)
        self._tf = rospy.Publisher(f"{namespace}/tf", TFMessage, queue_size=100)
        self._static = rospy.Publisher(f"{namespace}/tf_static", TFMessage, queue_size=1, latch=True)
        self._mount = TFMessage([transform("base_link", "sonar", self._shift, *mission.sonar_in_base)])
        self._static.publish(self._mount)
        self._fixes = Inbox(f"{namespace}/MLSM/odometry", Odometry)
        self._diagnostics, self._scans_sent = Diagnostics(f"{namespace}/mlsm_core"), 0
        self._sent_until = mission.scans[0].start - 1.0
        self._fixed_at: Dict[float, float] = {}

    def die_often(self, kills: int) -> List[Kill]:
        """Go through the mission in `kills` + 1 parts, and die between them; return what became of each kill."""
        first, *others = np.array_split(np.arange(len(self._mission.scans)), kills + 1)
        node, found = self._started(), []
        try:
            self._go(first)
            wait_until(self._file.exists)
            for part in others:
                threading.Event().wait(random.uniform(0.0, 2.0 * PERIOD))
                self._end(node)
                node, *losses = self._started_again(time.monotonic())
                self._go(part)
                found.append(Kill(*losses, *self._fate(part)))
        finally:
            self._end(node)
        return found

    def _end(self, node: "subprocess.Popen[bytes]") -> None:
        node.kill()
        node.wait()
        self._diagnostics.forget()
        self._scans_sent = 0
        forget_links(self._static, self._mount)
        forget_links(self._tf, TFMessage())
        forget_links(self._echoes, StampedIntensityCloud())

    def _started(self) -> "subprocess.Popen[bytes]":
        names = [f"/{name}:={self._namespace}/{name}" for name in ("tf", "tf_static")]
        return started_core(self._namespace, [self._tf, self._static, self._echoes], names=names)

    def _started_again(self, killed: float) -> Tuple["subprocess.Popen[bytes]", float, float]:
        """Start the node; return it, the share of the map that it kept, and the seconds that were lost.

        Raises MapFileError for a file that is not whole.
        """
        stored = read_map(self._file)
        node = self._started()
        self._sent_until += random.uniform(*AWAY)
        saved_until = StoredPlace.of_arrays(stored.arrays).belief.time - self._shift
        unsaved = [came for end, came in self._fixed_at.items() if end > saved_until + ROUNDING]
        self._fixed_at.clear()
        saved = {tuple(cell) for cell in stored.shown.cells.tolist()}
        held = cells_of(held_points(self._namespace).astype(np.float64), stored.shown.resolution)
        kept = len(saved & {tuple(cell) for cell in held.tolist()}) / len(saved)
        return node, kept, killed - min(unsaved, default=killed)

    def _go(self, part: np.ndarray) -> None:
        """Send scans; those that end while no node listens are lost."""
        for scan in [self._mission.scans[number] for number in part]:
            if scan.reference_time + AHEAD > self._sent_until:
                self._send_odometry(scan.reference_time + AHEAD)
                self._echoes.publish(cloud_to_message(self._cloud(scan)))
                self._scans_sent += 1
                wait_until(partial(self._is_done_with, scan), LATEST_FIX, required=False)
                if self._is_fixed(scan):
                    self._fixed_at[scan.reference_time] = time.monotonic()

    def _is_done_with(self, scan: Scan) -> bool:
        """Tell whether the node has matched a scan, or tells that it has used all that were sent to it."""
        counted = self._diagnostics.values("mlsm_core")
        return self._is_fixed(scan) or sum(int(counted.get(key, 0)) for key in USED) >= self._scans_sent

    def _is_fixed(self, scan: Scan) -> bool:
        return scan.reference_time in self._fixed()

    def _cloud(self, scan: Scan) -> Cloud:
        stamps = np.where(scan.moving, 1.0, -1.0) * (scan.times + self._shift)
        end = rospy.Time.from_sec(scan.reference_time + self._shift)
        return Cloud(scan.points.astype(np.float32), stamps, end.to_nsec(), "odom")

    def _send_odometry(self, until: float) -> None:
        track = self._mission.odometry
        first, last = np.searchsorted(track.times, [self._sent_until, until])
        known = zip(track.times[first:last], track.poses[first:last])
        self._tf.publish([transform("odom", "base_link", time + self._shift, *pose) for time, pose in known])
        self._sent_until = until

    def _fixed(self) -> Dict[float, Odometry]:
        """Return all fixes by the end of their scan [s]."""
        ends = np.array([scan.reference_time for scan in self._mission.scans])
        stamps = [(fix.header.stamp.to_sec() - self._shift, fix) for fix in self._fixes.messages]
        return {float(ends[np.abs(ends - stamp).argmin()]): fix for stamp, fix in stamps}

    def _fate(self, part: np.ndarray) -> Tuple[Fate, float, float]:
        """Return what became of the place in a part, with distance and deviation [m] of the fix that is farthest."""
        fixed = self._fixed()
        ends = [self._mission.scans[number].reference_time for number in part]
        found = [number for number, end in enumerate(ends) if end in fixed]
        if not found:
            return Fate.NOT_FOUND, np.nan, np.nan
        errors = [self._error(ends[number], fixed[ends[number]]) for number in found]
        distance, deviation = max(errors)
        if any(error > self._mission.tolerance + DEVIATIONS * told for error, told in errors):
            return Fate.WRONG, distance, deviation
        return (Fate.GOES_ON if found[0] < EXPECTED_SCANS else Fate.FOUND_AGAIN), distance, deviation

    def _error(self, end: float, fix: Odometry) -> Tuple[float, float]:
        """Return how far a fix is from the wanted place, and what it says of that, m."""
        place, covariance = fix.pose.pose.position, fix.pose.covariance
        away = np.array([place.x, place.y]) - self._mission.wanted.at(np.array(end))[:2]
        return float(np.hypot(*away)), float(np.sqrt(covariance[0] + covariance[7]))
