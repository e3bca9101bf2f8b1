"""What two maps have in common, and what only one of them has."""

from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, cells_of
from mlsm_manager.surface_map.cell_index import cell_keys
from mlsm_manager.surface_map.files.map_file import StoredMap
from mlsm_manager.surface_map.linkage import intervals_of, joined, link


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
    if not len(first) or not len(second):
        return np.arange(len(first)), len(first) + np.arange(len(second))
    intervals, others = (
        intervals_of(blocks, cell_keys(cells_of(blocks.mean, blocks.resolution))) for blocks in (first, second)
    )
    both = joined(replace(intervals, row=np.arange(len(first))), others)
    order = np.lexsort((both.bottom, both.cell))
    starts = link(both.take(order), first.resolution)
    groups = np.empty(len(both), dtype=np.int64)
    groups[order] = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(both))))
    return groups[: len(first)], groups[len(first) :]


def _tops(groups: np.ndarray, height: np.ndarray) -> np.ndarray:
    tops = np.full(int(groups.max(initial=-1)) + 1, -np.inf)
    np.maximum.at(tops, groups, height)
    return tops


def cropped(stored: StoredMap, low: np.ndarray, high: np.ndarray) -> StoredMap:
    """Return the map with those blocks only whose mean lies from `low` to `high`, (2,) x y or (3,) x y z [m]."""
    return replace(stored, layers={layer: blocks.in_box(low, high) for layer, blocks in stored.layers.items()})
