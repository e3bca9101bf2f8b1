"""Points of scans, appended scan by scan."""

from dataclasses import fields
from typing import List

import numpy as np

from mlsm_manager.joint_solver.measured.growing import GrowingArray
from mlsm_manager.joint_solver.measured.surface_points import SurfacePoints


class PointTable:
    """The points of scans 0, 1, ... in the order of time."""

    def __init__(self) -> None:
        self._starts: List[int] = [0]
        self._scans = GrowingArray()
        self._points = {field.name: GrowingArray() for field in fields(SurfacePoints)}
        self._points["normals"] = GrowingArray(2)

    @property
    def scan_count(self) -> int:
        """Number of scans so far."""
        return len(self._starts) - 1

    @property
    def counts(self) -> np.ndarray:
        """(scan_count,) int, number of points of each scan."""
        return np.diff(self._starts)

    def append(self, points: SurfacePoints) -> None:
        """Append the points of one scan."""
        for name, array in self._points.items():
            array.extend(getattr(points, name))
        self._scans.extend(np.full(len(points), self.scan_count))
        self._starts.append(self._starts[-1] + len(points))

    def since(self, scan: int) -> "PointTable":
        """Return a table of `scan` and all later ones, the first of which is number 0 there."""
        later = PointTable()
        for number in range(scan, self.scan_count):
            later.append(self.points(self.rows(number, number + 1)))
        return later

    def remove_newest(self) -> None:
        """Take back the last `append`."""
        self._starts.pop()
        for array in (*self._points.values(), self._scans):
            array.shorten(self._starts[-1])

    def rows(self, first: int, last: int) -> np.ndarray:
        """Return the rows (n,) of the points of scans `first` to `last` - 1, oldest scan first."""
        return np.arange(self._starts[first], self._starts[last])

    def points(self, rows: np.ndarray) -> SurfacePoints:
        """Return the points in `rows` (n,) int."""
        return SurfacePoints(**{name: array.values[rows] for name, array in self._points.items()})

    def scans(self, rows: np.ndarray) -> np.ndarray:
        """Return the scan (n,) int of each point in `rows`."""
        return self._scans.values[rows].astype(np.int64)
