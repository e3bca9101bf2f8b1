"""Points of scans in the map."""

from dataclasses import dataclass, fields, replace
from typing import Union

import numpy as np


@dataclass(frozen=True)
class PlacedPoints:
    """n points in the map.

    scans: (n,) which scan heard them. places: (n, 2) m. arms: (n, 2) m, by which the nodes' yaw turns them: from
    base_link to them, and the bow of the path between the nodes. normals: (n, 2). slants: (n,) m. qualities: (n,).
    shares: (n,) when they were heard: 0 at the scan's first node, 1 at its second. by_run: (n, 2, 2) derivatives of the
    places by range scale and delay, last axis the unknown.
    """

    scans: np.ndarray
    places: np.ndarray
    arms: np.ndarray
    normals: np.ndarray
    slants: np.ndarray
    qualities: np.ndarray
    shares: np.ndarray
    by_run: np.ndarray

    def __len__(self) -> int:
        return len(self.scans)

    def moved_by_run(self, change: np.ndarray) -> "PlacedPoints":
        """Return the points after the run's unknowns changed a little, by `change` (2,), to first order."""
        places = self.places + self.by_run @ change
        return replace(self, places=places)

    def selected(self, rows: Union[np.ndarray, slice]) -> "PlacedPoints":
        """Return the points in `rows`: indices, (n,) bool, or a slice, which copies nothing."""
        return PlacedPoints(*(getattr(self, field.name)[rows] for field in fields(self)))

    def joined_with(self, others: "PlacedPoints") -> "PlacedPoints":
        """Return these points and then the others."""
        names = [field.name for field in fields(self)]
        return PlacedPoints(*(np.concatenate([getattr(self, name), getattr(others, name)]) for name in names))


NO_POINTS = PlacedPoints(
    scans=np.empty(0, dtype=np.int64), places=np.empty((0, 2)), arms=np.empty((0, 2)), normals=np.empty((0, 2)),
    slants=np.empty(0), qualities=np.empty(0), shares=np.empty(0), by_run=np.empty((0, 2, 2)),
)  # fmt: skip
