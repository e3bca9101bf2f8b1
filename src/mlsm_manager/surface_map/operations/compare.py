"""What two maps have in common, and what only one of them has."""

from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.files.map_file import StoredMap
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


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
    group_first, group_second = _groups(first, second)
    common = np.intersect1d(group_first, group_second)
    in_first, in_second = np.isin(group_first, common), np.isin(group_second, common)
    shift = _tops(group_second, second.height)[common] - _tops(group_first, first.height)[common]
    return Difference(first.take(~in_first), second.take(~in_second), first.take(in_first), shift)


def _groups(first: Blocks, second: Blocks) -> Tuple[np.ndarray, np.ndarray]:
    """Return for blocks (n,) and (m,) the number of the block that they would be part of in one map."""
    both = MultiLevelSurfaceMap(first.resolution, limit=np.inf, expected_blocks=len(first) + len(second))
    both.insert_blocks(first)
    both.insert_blocks(second)
    return _holders(both, first), _holders(both, second)


def _holders(surface_map: MultiLevelSurfaceMap, parts: Blocks) -> np.ndarray:
    """Return the row (n,) of the map's block that each of `parts` (n) is part of."""
    blocks, rows, owners = surface_map.find(parts.cells)
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
    return replace(stored, layers={layer: blocks.in_box(low, high) for layer, blocks in stored.layers.items()})
