"""How wide a sonar's beam is, from the walls in its own scans: they must be straight.

A beam that hears to either side of its axis bends a wall that it meets aslant. The half width that bends the walls of
a recording back is the effective one, whatever the data sheet says. No map, no matching and no truth take part.
"""

from typing import List

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.localisation.sensor_model import at_beam_edge
from mlsm_manager.matching.problem.scan import Scan

_REACH = 12.0
_FEWEST = 6
_RANGE_NOISE = 0.1
_HALF_WIDTHS = np.linspace(0.0, 0.12, 9)
_MOST_SCANS = 30
_FEWEST_SCANS = 5
_SURE = 2.0


def half_width_of(scans: List[Scan]) -> float:
    """Return the half width [rad] with which the walls of the scans are straightest; 0 where none is surely better."""
    some = scans[:: max(len(scans) // _MOST_SCANS, 1)]
    table = np.array([[roughness(at_beam_edge(scan, width)) for width in _HALF_WIDTHS] for scan in some])
    table = table.reshape(-1, len(_HALF_WIDTHS))
    table = table[np.isfinite(table).all(axis=1)]
    if len(table) < _FEWEST_SCANS:
        return 0.0
    best = int(table.mean(axis=0).argmin())
    gain = table[:, 0] - table[:, best]
    if best == 0 or gain.mean() < _SURE * gain.std() / np.sqrt(len(gain)):
        return 0.0
    return _between(table.mean(axis=0), best)


def roughness(scan: Scan) -> float:
    """Return the mean logarithm of how thick the scan is [m^2] within 12 m of each point; NaN without neighbours."""
    points = scan.points[:, :2]
    if len(points) < _FEWEST:
        return float("nan")
    pairs = cKDTree(points).query_pairs(_REACH, output_type="ndarray")
    own = np.arange(len(points))
    first = np.concatenate([pairs[:, 0], pairs[:, 1], own])
    second = np.concatenate([pairs[:, 1], pairs[:, 0], own])
    count = np.bincount(first)
    mean = np.column_stack([np.bincount(first, points[second, axis]) for axis in range(2)]) / count[:, np.newaxis]
    offset = points[second] - mean[first]
    xx, xy, yy = (np.bincount(first, offset[:, a] * offset[:, b]) / count for a, b in ((0, 0), (0, 1), (1, 1)))
    thickness = (xx + yy) / 2.0 - np.hypot((xx - yy) / 2.0, xy)
    thick = np.log(_RANGE_NOISE**2 + np.maximum(thickness, 0.0))[count >= _FEWEST]
    return float(thick.mean()) if thick.size else float("nan")


def _between(curve: np.ndarray, best: int) -> float:
    """Return where the parabola through the lowest value of the curve and its neighbours is lowest."""
    step = _HALF_WIDTHS[1] - _HALF_WIDTHS[0]
    if best == len(curve) - 1:
        return float(_HALF_WIDTHS[best])
    left, low, right = curve[best - 1 : best + 2]
    return float(_HALF_WIDTHS[best] + 0.5 * step * (left - right) / (left - 2.0 * low + right))
