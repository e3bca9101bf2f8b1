"""Which points a map takes."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True)
class InsertReport:
    """What became of the points of one insertion."""

    inserted: int
    not_finite: int
    outside: int


class Admitted(NamedTuple):
    """points: (m, 4) that an insertion takes. report: of what becomes of all."""

    points: np.ndarray
    report: InsertReport


def admitted(points: np.ndarray, limit: float) -> Admitted:
    """Return those of points (n, 4) that are finite and lie within `limit` [m] of the origin along each axis."""
    points = np.asarray(points, dtype=np.float64)
    finite = np.isfinite(points).all(axis=1)
    with np.errstate(invalid="ignore"):
        inside = (np.abs(points[:, :3]) <= limit).all(axis=1)
    keep = finite & inside
    kept = points if keep.all() else points[keep]
    not_finite = len(points) - int(np.count_nonzero(finite))
    return Admitted(kept, InsertReport(len(kept), not_finite, len(points) - len(kept) - not_finite))
