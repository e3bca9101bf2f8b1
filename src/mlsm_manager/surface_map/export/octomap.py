"""Maps as OctoMap's trees, through its own library (Hornung et al. 2013)."""

from pathlib import Path
from typing import Any, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import ExportError
from node_support.files import whole_file

_HIT, _MISS = 0.85, -0.4  # log-odds of one hit and one miss, OctoMap's own (probabilities 0.7 and 0.4)
_MOST_HITS, _MOST_MISSES = 5, 5  # more change nothing: OctoMap keeps log-odds between -2 and 3.5
_HALF_TREE = 32768  # an OcTree has 16 levels: so many cells to each side of the origin
_MOST_VOXELS = 100_000_000  # a tree of more takes gigabytes; one tall block of noise can ask for that
_HOW_TO_INSTALL = "needs pyoctomap; install it with: pip install pyoctomap"


def write_octree(path: Path, occupied: Blocks, free: Blocks) -> None:
    """Write all that is occupied and free as voxels of the map's resolution, whole or not at all.

    With the ending .bt what is free or occupied, with .ot the log-odds too. A block fills the voxels from its bottom to
    its top. Raises ExportError for a map that is too wide for a tree or without pyoctomap, and OSError.
    """
    tree = octree(occupied, free)
    write = tree.writeBinary if path.suffix == ".bt" else tree.write
    with whole_file(path) as temporary:
        if not write(str(temporary)):
            raise ExportError(f"{path}: OctoMap could not write it")


def octree(occupied: Blocks, free: Blocks) -> Any:
    """Return a pyoctomap.OcTree. Raises ExportError."""
    tree = _empty_tree(occupied.resolution)
    voxels, owners = block_voxels(occupied)
    free_voxels, free_owners = block_voxels(free)
    # Where blocks are, nothing is free: the tree would add up both and forget the block.
    only_free = ~np.isin(_numbers(free_voxels), _numbers(voxels))
    _update(tree, free_voxels[only_free], np.minimum(free.count[free_owners[only_free]], _MOST_MISSES) * _MISS)
    _update(tree, voxels, np.minimum(occupied.count[owners], _MOST_HITS) * _HIT)
    tree.updateInnerOccupancy()
    return tree


def _update(tree: Any, voxels: np.ndarray, log_odds: np.ndarray) -> None:
    for value in np.unique(log_odds):
        centers = (voxels[log_odds == value] + 0.5) * tree.getResolution()
        tree.updateNodes(centers, float(value), lazy_eval=True)


def _numbers(voxels: np.ndarray) -> np.ndarray:
    """Return one int64 for each voxel (n, 3) of a tree."""
    return (voxels + _HALF_TREE) @ np.array([(2 * _HALF_TREE) ** 2, 2 * _HALF_TREE, 1])


def block_voxels(blocks: Blocks) -> Tuple[np.ndarray, np.ndarray]:
    """Return the (m, 3) int64 voxels that blocks (n) fill, voxel i from i to i + 1 times the resolution, and whose.

    The second is (m,), an index of the block. Raises ExportError where they lie too far out for a tree.
    """
    first, last = (np.floor(ends / blocks.resolution).astype(np.int64) for ends in (blocks.bottom, blocks.height))
    number = last - first + 1
    if number.sum() > _MOST_VOXELS:
        raise ExportError(f"{int(number.sum())} voxels, must be at most {_MOST_VOXELS}; crop the map first")
    owners = np.repeat(np.arange(len(blocks)), number)
    rank = np.arange(len(owners)) - np.repeat(np.cumsum(number) - number, number)
    voxels = np.column_stack([blocks.cells[owners], first[owners] + rank])
    if not (voxels.min(initial=0) >= -_HALF_TREE and voxels.max(initial=0) < _HALF_TREE):
        reach = _HALF_TREE * blocks.resolution
        raise ExportError(f"reaches beyond {reach:g} m, the end of an OcTree of this resolution; crop the map first")
    return voxels, owners


def _empty_tree(resolution: float) -> Any:
    try:
        import pyoctomap
    except ImportError:
        raise ExportError(_HOW_TO_INSTALL) from None
    except ValueError as error:
        raise ExportError(f"pyoctomap does not load with numpy {np.__version__}; use a newer one: {error}") from error
    return pyoctomap.OcTree(resolution)
