"""What is wrong with a run that goes on: looked for in its newest scans and in the steps of its odometry."""

import threading
from collections import deque
from typing import Deque, List, Sequence, Tuple

import numpy as np

from mlsm_manager.odometry.mending import stuck_headings
from mlsm_manager.odometry.steps import Step
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.causes import Cause, of_steps, of_stuck, ranked, widened
from mlsm_manager.self_check.echo_causes import echo_findings
from mlsm_manager.self_check.standing import standing_causes
from node_support.geometry import composed, inverse

_NEWEST = 30  # scans that are compared
_FEWEST = 6  # scans: fewer pairs do not show how alike pairs of this water are
_BETWEEN = 3  # scans between two looks: a look takes most of a second of a core
_MOST_PLACES = 20000  # four days of scans of 16 s


class LiveCauses:
    """Safe to use from several threads: one gives it scans, another looks at them."""

    def __init__(self) -> None:
        self.sonar_in_base = np.zeros(2)
        self._lock = threading.Lock()
        self.clear()

    def clear(self) -> None:
        """Forget the run."""
        with self._lock:
            self._scans: Deque[Scan] = deque(maxlen=_NEWEST)
            self._places: Deque[Tuple[float, float, float]] = deque(maxlen=_MOST_PLACES)
            self._corrections: Deque[np.ndarray] = deque(maxlen=_NEWEST)
            self._new = 0
            self._found: List[Cause] = []

    def take(self, scan: Scan, pose: np.ndarray) -> None:
        """Learn a scan, whose odometry does not jump, and T_map_base (3,) at its end."""
        with self._lock:
            self._scans.append(scan)
            self._corrections.append(composed(pose, inverse(scan.reference_pose)))
            self._places.append((scan.reference_time, float(pose[0]), float(pose[1])))
            self._new += 1

    def look(self) -> None:
        """Look for causes in the newest scans, if there are enough new ones since the last look."""
        with self._lock:
            if self._new < _BETWEEN or len(self._scans) < _FEWEST:
                return
            self._new, scans, places = 0, list(self._scans), self._places
            corrections = Track(np.array([scan.reference_time for scan in scans]), np.array(self._corrections))
        track = _track(scans)
        found = [*echo_findings(scans, self.sonar_in_base, corrections).causes, *standing_causes(scans, track)]
        found += [of_stuck(*one) for one in stuck_headings(track)]
        with self._lock:
            if self._places is places:
                self._found = found

    def causes(self, steps: Sequence[Step]) -> List[Cause]:
        """Return what is wrong, ranked; steps: of the odometry, which were left out."""
        return ranked([*of_steps(steps), *self._found])

    def covariance(self, steps: Sequence[Step]) -> np.ndarray:
        """Return what the causes add to the covariance (2, 2) [m^2] of the newest place."""
        causes = self.causes(steps)
        with self._lock:
            places = np.array(self._places if causes else [])
        if not len(places):
            return np.zeros((2, 2))
        return widened(np.zeros((len(places), 2, 2)), places[:, 0], places[:, 1:], causes)[-1]


def _track(scans: Sequence[Scan]) -> Track:
    """Return T_odom_base of all scans."""
    times, first = np.unique(np.concatenate([scan.track.times for scan in scans]), return_index=True)
    return Track(times, np.concatenate([scan.track.poses for scan in scans])[first])
