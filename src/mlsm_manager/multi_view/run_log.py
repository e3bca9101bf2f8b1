"""What was measured during a run: surface points of every scan, the nodes' times and the odometry."""

from dataclasses import fields
from typing import List

import numpy as np

from mlsm_manager.matching.scan import Scan
from mlsm_manager.multi_view.odometry_timeline import OdometryTimeline
from mlsm_manager.multi_view.surface_points import SurfacePoints
from node_support.refused_input import RefusedInput

_FIRST_CAPACITY = 4096
_SHORTEST_SCAN = 1.0  # s: a first scan without points still needs a beginning before its end


class RunLog:
    """Scan k lies between nodes k and k + 1; node k + 1 is at the time of the scan's last beam.

    sonar_in_base: (2,) m.
    """

    def __init__(self, sonar_in_base: np.ndarray) -> None:
        self.sonar_in_base = np.asarray(sonar_in_base, dtype=np.float64)
        self.odometry = OdometryTimeline()
        self._node_times: List[float] = []
        self._starts: List[int] = [0]
        empty = np.empty(0)
        self._points = SurfacePoints(empty, empty, empty, np.empty((0, 2)), empty)
        self._scans = np.empty(0, dtype=np.int64)

    @property
    def scan_count(self) -> int:
        """Number of scans so far."""
        return len(self._starts) - 1

    @property
    def node_times(self) -> np.ndarray:
        """(scan_count + 1,) s."""
        return np.array(self._node_times)

    def append(self, scan: Scan, lookahead: float) -> None:
        """Append a scan and the odometry of its track up to `lookahead` seconds after its end.

        Raises RefusedInput for a scan that does not end later than the one before.
        """
        if self._node_times and scan.reference_time <= self._node_times[-1]:
            raise RefusedInput(
                "scans out of order",
                f"ends at {scan.reference_time:.3f} s, the one before {self._node_times[-1]:.3f} s",
            )
        if not self._node_times:
            self._node_times.append(min(scan.start, scan.reference_time - _SHORTEST_SCAN))
        self._node_times.append(scan.reference_time)
        self.odometry.extend(scan.track, scan.reference_time + lookahead)
        self._append_points(SurfacePoints.of(scan, self.sonar_in_base))

    def _append_points(self, points: SurfacePoints) -> None:
        start, scan = self._starts[-1], self.scan_count
        end = start + len(points)
        if end > len(self._scans):
            capacity = max(_FIRST_CAPACITY, end, 2 * len(self._scans))
            self._points = _enlarged(self._points, start, capacity)
            self._scans = np.concatenate([self._scans[:start], np.empty(capacity - start, dtype=np.int64)])
        for field in fields(points):
            getattr(self._points, field.name)[start:end] = getattr(points, field.name)
        self._scans[start:end] = scan
        self._starts.append(end)

    def points_of(self, first: int, last: int) -> SurfacePoints:
        """Return the points of scans `first` to `last` - 1, oldest scan first."""
        rows = slice(self._starts[first], self._starts[last])
        return SurfacePoints(*(getattr(self._points, field.name)[rows] for field in fields(SurfacePoints)))

    def scans_of(self, first: int, last: int) -> np.ndarray:
        """Return the scan of each point that `points_of` returns."""
        return self._scans[self._starts[first] : self._starts[last]]

    def node_poses(self, first: int, last: int) -> np.ndarray:
        """Return T_odom_base (n, 3) at nodes `first` to `last` (both included)."""
        return self.odometry.at(np.array(self._node_times[first : last + 1]))


def _enlarged(points: SurfacePoints, count: int, capacity: int) -> SurfacePoints:
    arrays = [getattr(points, field.name) for field in fields(SurfacePoints)]
    return SurfacePoints(
        *(np.concatenate([array[:count], np.empty((capacity - count, *array.shape[1:]))]) for array in arrays)
    )
