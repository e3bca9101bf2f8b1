"""Carves free space (thesis 6.2.1, type FREE) out of what is unknown, and takes blocks away that beams go through.

What a beam says. Its first echo says that nothing nearer, in the whole fan, echoes strongly enough to be heard.
Sideways the fan is narrow (2.5 deg) and says where free space is. In height it is wide (22 deg: 8 m at 20 m), so that
"free" is a statement about the plane in which the vehicle moves and not about what lies above or below it. A crossed
cell is therefore noted free at the height of the beam's axis only, while a block speaks against a beam, and the beam
against the block, when it lies in the inner part of the fan, where echoes are loud.

What is kept. Of each block how many points fell into it and how many beams crossed it since the last of them did.
Counts and not log-odds: they do not depend on the order of beams within a scan, need no limits to stay able to change,
and add up when maps are merged.
"""

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, ROW_WIDTH, TOP, Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import bearings_of, cell_keys, keys_of, members
from node_support.parameters import ParameterSet, parameter

_MOST_POINTS = 50  # more make a block no surer: a ship that lay there for an hour has left once it is not heard
_ENOUGH = 5  # so many crossings make a cell as free as it gets: OctoMap's cells too reach their limit after five misses


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


def beam_paths(beams: FirstEchoes, width: float, resolution: float) -> BeamPaths:
    """Return the cells of side `resolution` [m] that beams `width` [rad] wide crossed before their first echo.

    The last cell before the echo and the one beside it are left out: an echo lies anywhere in its bin, and a pose is
    not known to the centimetre. A beam is sampled once per cell along its axis, and across it where it is wider.
    """
    arm = beams.echoes[:, :2] - beams.origins[:, :2]
    reach = np.hypot(*arm.T)
    steps = np.maximum((reach / resolution - 0.5).astype(np.int64), 0)
    beam, cell = members(steps)
    distance = cell * resolution
    across = (width * distance / resolution).astype(np.int64) + 1
    sample, number = members(across)
    share = (number + 0.5) / across[sample] - 0.5
    beam, distance = beam[sample], distance[sample]
    angle = bearings_of(arm)[beam] + width * share
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


def pairs_of_groups(starts: np.ndarray, count: int, owners: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return all pairs (p,), (p,) of an index into `owners` and a member of its group.

    Members 0 to `count` - 1 are sorted by group; group g begins at `starts[g]`. owners: (n,) the group of each.
    """
    owner, rank = members(np.diff(np.append(starts, count))[owners])
    return owner, starts[owners][owner] + rank


@dataclass(frozen=True)
class CarvingParameters(ParameterSet):
    """What crossing beams say."""

    carve: bool = parameter(
        True, "mark space that beams crossed as free, and take blocks away that beams go through", tunable=False
    )
    fan_core: float = parameter(
        0.19, "vertical angle of the inner part of the fan, in which a beam surely hears what is there", unit="rad",
        low=0.0, high=3.0, tunable=False, expert="11 deg: half of a usual fan's 22 deg, in which the beam is loud",
    )  # fmt: skip
    crossings_least: int = parameter(
        10, "a block is removed once so many beams in a row have crossed it", low=1, high=10000,
        expert="one beam or two may miss a block by chance; what ten in a row cross is gone",
    )  # fmt: skip
    crossings_per_point: float = parameter(
        2.0, f"added to crossings_least for each point of the block, at most {_MOST_POINTS} points", low=0.0,
        high=1000.0, tunable=False, expert="what was heard often must be missed more often",
    )  # fmt: skip


@dataclass(frozen=True)
class CarveReport:
    """free: cells that a scan crossed. crossed: blocks that its beams went through. removed: blocks that went."""

    free: int
    crossed: int
    removed: int

    def __add__(self, other: "CarveReport") -> "CarveReport":
        return CarveReport(self.free + other.free, self.crossed + other.crossed, self.removed + other.removed)


@dataclass(frozen=True)
class BeamFindings:
    """What the beams of a scan say of a map as it was when they were asked.

    free: a block for each cell that is free. crossed: (m) copies of blocks that were crossed. rows: (m,) where the map
    keeps them, until it changes. beams: (m,) number of beams that crossed each.
    """

    free: Blocks
    crossed: Blocks
    rows: np.ndarray
    beams: np.ndarray


@dataclass(frozen=True)
class Carver:
    """Applies the beams of a scan to the map of what is occupied and to that of what is free.

    beam_width: horizontal, rad. The cost depends on the cells that the scan's beams cross and not on the map.
    """

    parameters: CarvingParameters
    beam_width: float

    def carve(
        self, occupied: MultiLevelSurfaceMap, free: MultiLevelSurfaceMap, beams: FirstEchoes, points: np.ndarray
    ) -> Tuple[CarveReport, Blocks]:
        """Carve a scan whose points (n, >= 3) are in `occupied` already; `free` has cells of the same side.

        Return a report, and what was not known to be free.
        """
        findings = self.findings(occupied, beams, points)
        occupied.count_crossings(findings.rows, findings.beams)
        gone = self.is_outworn(findings.crossed, findings.crossed.crossed + findings.beams)
        occupied.remove(findings.rows[gone])
        noted = note_free(free, findings.free)
        return CarveReport(len(findings.free.rows), len(findings.rows), int(np.count_nonzero(gone))), noted

    def findings(self, occupied: MultiLevelSurfaceMap, beams: FirstEchoes, points: np.ndarray) -> BeamFindings:
        """Return what a scan says whose points (n, >= 3) are in `occupied` already.

        A beam says nothing about what lies behind the first block in its way, even where its echo came from farther:
        either that block or that echo is wrong. That block counts a crossing, unless the scan itself hit its cell.
        """
        paths = beam_paths(beams, self.beam_width, occupied.resolution)
        cells = cell_keys(paths.cells)
        hit = np.isin(cells, keys_of(points, occupied.resolution))
        blocks, rows, owners = occupied.find(cells)
        pair, block = self._meetings(paths, blocks, owners)
        first = np.full(len(beams.origins), np.inf)
        np.minimum.at(first, paths.beam[pair], paths.distance[pair])
        crossing = (paths.distance[pair] == first[paths.beam[pair]]) & ~hit[paths.cell[pair]]
        before = (paths.distance < first[paths.beam]) & ~hit[paths.cell]
        number = np.bincount(block[crossing], minlength=len(rows))
        crossed = np.flatnonzero(number)
        free = _free_blocks(paths.cells, paths.cell[before], paths.height[before], occupied.resolution)
        return BeamFindings(free, blocks.take(crossed), rows[crossed], number[crossed])

    def is_outworn(self, blocks: Blocks, crossings: np.ndarray) -> np.ndarray:
        """Return (n,) which of the blocks must go after so many crossings (n,) in a row."""
        points = np.minimum(blocks.count, _MOST_POINTS)
        return crossings > self.parameters.crossings_least + self.parameters.crossings_per_point * points

    def _meetings(self, paths: BeamPaths, blocks: Blocks, owners: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return pairs (k,) of `paths` and blocks (k,) that lie in the way of their beams."""
        block, pair = pairs_of_groups(paths.starts, len(paths.cell), owners)
        half = np.maximum(paths.distance[pair] * np.tan(self.parameters.fan_core / 2.0), blocks.resolution / 2.0)
        above = blocks.rows[block, BOTTOM] - paths.height[pair]
        below = paths.height[pair] - blocks.rows[block, TOP]
        inside = np.maximum(above, below) <= half
        return pair[inside], block[inside]


def note_free(free: MultiLevelSurfaceMap, noted: Blocks) -> Blocks:
    """Put into `free` which of the blocks, one per cell, are not known well enough to be free at their height.

    Return these.
    """
    cells = noted.keys
    there, _, owners = free.find(cells)
    known = np.zeros(len(cells), dtype=bool)
    known[owners[(there.gaps(noted, owners) < free.resolution) & (there.count >= _ENOUGH)]] = True
    new = noted.take(~known)
    free.insert_blocks(new)
    return new


def _free_blocks(cells: np.ndarray, cell: np.ndarray, height: np.ndarray, resolution: float) -> Blocks:
    """Return one block for each of the `cells` (c, 2) that beams crossed: `cell` (p,), sorted, at `height` (p,) m."""
    if not len(cell):
        return Blocks.none(resolution)
    starts, _ = _runs(cell)
    rows = np.zeros((len(starts), ROW_WIDTH))
    rows[:, :2] = (cells[cell[starts]] + 0.5) * resolution
    rows[:, COUNT] = np.diff(np.append(starts, len(cell)))
    rows[:, BOTTOM] = np.minimum.reduceat(height, starts)
    rows[:, TOP] = np.maximum.reduceat(height, starts)
    rows[:, 2] = (rows[:, BOTTOM] + rows[:, TOP]) / 2.0
    return Blocks.uncrossed(rows, resolution)
