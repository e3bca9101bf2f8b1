"""Which cells each beam of a scan crossed before its first echo."""

from dataclasses import dataclass
from typing import Tuple

import numpy as np


@dataclass(frozen=True)
class FirstEchoes:
    """The beams of a scan that heard an echo, in the map's frame.

    origins: (b, 3) m, where the sonar was. echoes: (b, 3) m, the nearest echo of each on the axis of its beam.
    """

    origins: np.ndarray
    echoes: np.ndarray

    @staticmethod
    def of_points(points: np.ndarray, times: np.ndarray, origins: np.ndarray) -> "FirstEchoes":
        """Return the beams of points (n, >= 3) m, whose beams were taken at `times` (n,) s from `origins` (n, 3) m.

        Points of one time belong to one beam.
        """
        ranges = np.linalg.norm(points[:, :3] - origins, axis=1)
        order = np.lexsort((ranges, times))
        first = order[np.append(True, np.diff(times[order]) > 0.0)] if len(order) else order
        return FirstEchoes(origins[first], points[first, :3])

    @staticmethod
    def of_level(points: np.ndarray, times: np.ndarray, places: np.ndarray) -> "FirstEchoes":
        """As `of_points` for level beams from `places` (n, 2) m: the sonar is as deep as what it hears."""
        return FirstEchoes.of_points(points, times, np.column_stack([places, points[:, 2]]))


@dataclass(frozen=True)
class BeamPaths:
    """Pairs of a cell and a beam that crossed it, none twice, sorted by cell.

    cells: (c, 2) int64. starts: (c,) int64, where the pairs of each cell begin. cell: (p,) int64 index into `cells`.
    beam: (p,) int64 index. distance: (p,) m in the plane from the beam's origin. height: (p,) m of its axis there.
    """

    cells: np.ndarray
    starts: np.ndarray
    cell: np.ndarray
    beam: np.ndarray
    distance: np.ndarray
    height: np.ndarray

    def take(self, chosen: np.ndarray) -> "BeamPaths":
        """Return the chosen pairs, a mask (p,), and the cells that are left."""
        old = self.cell[chosen]
        starts, cell = _runs(old)
        return BeamPaths(
            self.cells[old[starts]], starts, cell, self.beam[chosen], self.distance[chosen], self.height[chosen]
        )


def beam_paths(beams: FirstEchoes, width: float, resolution: float) -> BeamPaths:
    """Return the cells of side `resolution` [m] that beams `width` [rad] wide crossed before their first echo.

    The last cell before the echo and the one beside it are left out: an echo lies anywhere in its bin, and a pose is
    not known to the centimetre. A beam is sampled once per cell along its axis, and across it where it is wider.
    """
    arm = beams.echoes[:, :2] - beams.origins[:, :2]
    reach = np.hypot(*arm.T)
    steps = np.maximum((reach / resolution - 0.5).astype(np.int64), 0)
    beam = np.repeat(np.arange(len(steps)), steps)
    distance = (np.arange(len(beam)) - np.repeat(np.cumsum(steps) - steps, steps)) * resolution
    across = (width * distance / resolution).astype(np.int64) + 1
    sample = np.repeat(np.arange(len(beam)), across)
    share = (np.arange(len(sample)) - np.repeat(np.cumsum(across) - across, across) + 0.5) / across[sample] - 0.5
    beam, distance = beam[sample], distance[sample]
    angle = np.arctan2(arm[:, 1], arm[:, 0])[beam] + width * share
    places = beams.origins[beam, :2] + distance[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)])
    rise = (beams.echoes[:, 2] - beams.origins[:, 2]) / np.maximum(reach, resolution)
    return _pairs(beam, distance, beams.origins[beam, 2] + rise[beam] * distance, np.floor(places / resolution))


def _pairs(beam: np.ndarray, distance: np.ndarray, height: np.ndarray, cells: np.ndarray) -> BeamPaths:
    """Return each pair of cell and beam once, with one of the samples (n) that made it."""
    cells = cells.astype(np.int64)
    low = cells.min(axis=0) if len(cells) else np.zeros(2, dtype=np.int64)
    rows = int(cells[:, 1].max() - low[1] + 1) if len(cells) else 1
    beams = int(beam.max(initial=0) + 1)
    number = ((cells - low) @ (rows, 1)) * beams + beam
    order = np.argsort(number)
    sample = order[_runs(number[order])[0]]
    pairs = number[sample]
    starts, cell = _runs(pairs // beams)
    where = pairs[starts] // beams
    where = np.column_stack([where // rows, where % rows]) + low
    return BeamPaths(where, starts, cell, pairs % beams, distance[sample], height[sample])


def _runs(values: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return where each run of equal values begins in sorted integers (n,), and the number of the run of each (n,)."""
    begins = np.diff(values, prepend=values[:1] - 1) != 0
    return np.flatnonzero(begins), np.cumsum(begins) - 1
