"""What is wrong with a run that goes on: looked for in its newest scans and in the steps of its odometry."""

import threading
from collections import deque
from typing import Deque, List, Sequence, Tuple

import numpy as np

from mlsm_manager.odometry.steps import Step
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.causes import Cause, of_steps, ranked, widened
from mlsm_manager.self_check.echo_causes import echo_findings
from mlsm_manager.self_check.standing import standing_causes

_NEWEST = 30  # scans that are compared: with 20 an unbroken marina was once said to have a slipping head
_FEWEST = 15  # scans: of ten, unbroken tours have been said to have the sonar upside down
_BETWEEN = 5  # scans between two looks: a look takes most of a second of a core
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
            self._new = 0
            self._found: List[Cause] = []

    def take(self, scan: Scan, place: np.ndarray) -> None:
        """Learn a scan, whose odometry does not jump, and where the vehicle was at its end, (2,) m."""
        with self._lock:
            self._scans.append(scan)
            self._places.append((scan.reference_time, float(place[0]), float(place[1])))
            self._new += 1

    def look(self) -> None:
        """Look for causes in the newest scans, if there are enough new ones since the last look."""
        with self._lock:
            if self._new < _BETWEEN or len(self._scans) < _FEWEST:
                return
            self._new, scans, places = 0, list(self._scans), self._places
        found = [*echo_findings(scans, self.sonar_in_base).causes, *standing_causes(scans, _track(scans))]
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
