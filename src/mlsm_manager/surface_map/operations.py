"""What is done with whole maps: moving, merging, cropping, comparing."""

from dataclasses import dataclass, replace

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, MEAN, SQUARES, TOP, Blocks
from mlsm_manager.surface_map.map_file import StoredMap
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.marks import Mark

_WHOLE_TURNS = 1e-12  # rad from a quarter turn, whose sine and cosine then are exactly 0 and 1


@dataclass(frozen=True)
class LevelTransform:
    """T_a_b between two level frames: x y z [m] of b in a, and yaw [rad] counter-clockwise about +z."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0

    def keeps_cells(self, resolution: float) -> bool:
        """Return whether it takes cells to cells: a whole number of cells along x and y, and of quarter turns."""
        cells = np.array([self.x, self.y]) / resolution
        return bool(np.abs(cells - np.rint(cells)).max() < 1e-9 and self._is_quarter())

    def rotation(self) -> np.ndarray:
        """Return the (2, 2) rotation in the plane."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        rotation = np.array([[cos, -sin], [sin, cos]])
        return np.rint(rotation) if self._is_quarter() else rotation

    def _is_quarter(self) -> bool:
        quarters = self.yaw / (np.pi / 2.0)
        return bool(abs(quarters - np.rint(quarters)) * np.pi / 2.0 < _WHOLE_TURNS)


def moved(blocks: Blocks, T_new_old: LevelTransform) -> Blocks:
    """Return the blocks in the new frame, one for each.

    All is exact, but where the yaw is no number of quarter turns only the sum of the variances of x and y is: blocks do
    not know how x and y vary together, and are taken as if they did not.
    """
    rows, rotation = blocks.rows.copy(), T_new_old.rotation()
    rows[:, :2] = rows[:, :2] @ rotation.T + (T_new_old.x, T_new_old.y)
    rows[:, [MEAN.start + 2, BOTTOM, TOP]] += T_new_old.z
    plane = slice(SQUARES.start, SQUARES.start + 2)
    rows[:, plane] = rows[:, plane] @ (rotation**2).T
    return Blocks(rows, blocks.resolution, blocks.crossed)


def merged_blocks(first: Blocks, second: Blocks, T_first_second: LevelTransform) -> Blocks:
    """Return the blocks of both in the frame of the first. Raises ValueError when their resolutions differ.

    Where the transform keeps cells (see LevelTransform) this is the map that all points together make: number of
    points, mean, variance, bottom and top of each block. Where it does not, each block of the second goes whole into
    the cell of its mean. Number, mean and variance of all points together stay exact, bottom and top of all too; a
    point on the rim of its block can then count for a cell that lies up to one cell beside its own.
    """
    return _together(first, moved(second, T_first_second)).blocks


def _together(first: Blocks, second: Blocks) -> MultiLevelSurfaceMap:
    both = MultiLevelSurfaceMap(first.resolution, limit=np.inf, expected_blocks=len(first) + len(second))
    both.insert_blocks(first)
    both.insert_blocks(second)
    return both


def merged(first: StoredMap, second: StoredMap, T_first_second: LevelTransform) -> StoredMap:
    """Return both maps as one, layer by layer, with frame, calibration and arrays of the first, which keeps its marks.

    Raises ValueError when the resolutions of a layer differ.
    """
    layers = dict(first.layers)
    for layer, blocks in second.layers.items():
        if layer in layers:
            layers[layer] = merged_blocks(layers[layer], blocks, T_first_second)
        else:
            layers[layer] = moved(blocks, T_first_second)
    marks = {mark.name: mark for mark in [*(_moved_mark(mark, T_first_second) for mark in second.marks), *first.marks]}
    return replace(first, layers=layers, marks=list(marks.values()))


def _moved_mark(mark: Mark, T_new_old: LevelTransform) -> Mark:
    x, y = T_new_old.rotation() @ (mark.x, mark.y) + (T_new_old.x, T_new_old.y)
    return Mark(mark.name, float(x), float(y), mark.z + T_new_old.z)


@dataclass(frozen=True)
class Difference:
    """Blocks of the first map that no block of the second touches, those of the second, and what both have.

    both: blocks of the first that touch some of the second. shift: (n,) m, for places that both have, by how much the
    highest point of the second lies above that of the first.
    """

    only_first: Blocks
    only_second: Blocks
    both: Blocks
    shift: np.ndarray


def difference(first: Blocks, second: Blocks) -> Difference:
    """Compare the blocks of two maps in one frame; blocks touch where points of one would join the other.

    Raises ValueError when their resolutions differ.
    """
    if first.resolution != second.resolution:
        raise ValueError(f"resolutions {first.resolution:g} m and {second.resolution:g} m: must be the same")
    both = _together(first, second)
    group_first, group_second = _holders(both, first), _holders(both, second)
    common = np.intersect1d(group_first, group_second)
    in_first, in_second = np.isin(group_first, common), np.isin(group_second, common)
    shift = _tops(group_second, second.height)[common] - _tops(group_first, first.height)[common]
    return Difference(first.take(~in_first), second.take(~in_second), first.take(in_first), shift)


def _holders(surface_map: MultiLevelSurfaceMap, parts: Blocks) -> np.ndarray:
    """Return the row (n,) of the map's block that each of `parts` (n) is part of."""
    blocks, rows, owners = surface_map.find(parts.keys)
    holds = (blocks.bottom <= parts.bottom[owners]) & (parts.bottom[owners] <= blocks.height)
    holders = np.empty(len(parts), dtype=np.int64)
    holders[owners[holds]] = rows[holds]
    return holders


def _tops(groups: np.ndarray, height: np.ndarray) -> np.ndarray:
    tops = np.full(int(groups.max(initial=-1)) + 1, -np.inf)
    np.maximum.at(tops, groups, height)
    return tops


def cropped(stored: StoredMap, low: np.ndarray, high: np.ndarray) -> StoredMap:
    """Return the map with those blocks only whose mean lies from `low` to `high`, (2,) x y or (3,) x y z [m]."""
    layers = {layer: blocks.in_box(low, high) for layer, blocks in stored.layers.items()}
    places = [np.array([mark.x, mark.y, mark.z][: len(low)]) for mark in stored.marks]
    inside = [mark for mark, place in zip(stored.marks, places) if (low <= place).all() and (place <= high).all()]
    return replace(stored, layers=layers, marks=inside)
