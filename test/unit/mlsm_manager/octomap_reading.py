"""Which cells OctoMap's own readers find in its trees."""

import re
import subprocess

import numpy as np

from mlsm_manager.surface_map.export.octomap import block_voxels

RESOLUTION = 0.5


def voxels(blocks):
    """Return the set of voxels that blocks fill."""
    return {tuple(voxel) for voxel in block_voxels(blocks)[0].tolist()}


def cells_of_tree(tree):
    """Return the voxels of a pyoctomap tree: {True: those occupied, False: those free}."""
    leaves = {True: set(), False: set()}
    for leaf in tree.begin_leafs():
        leaves[tree.isNodeOccupied(leaf)] |= _cells_of_leaf(leaf.getCoordinate(), leaf.getSize())
    return leaves


def cells_of_vrml(folder):
    """Return the occupied voxels of map.bt in a folder as apt's octomap-tools see them."""
    subprocess.run(["bt2vrml", "map.bt"], cwd=str(folder), check=True, stdout=subprocess.DEVNULL)
    boxes = re.findall(r"translation (\S+) (\S+) (\S+).*?size (\S+)", (folder / "map.bt.wrl").read_text(), re.S)
    return set().union(*(_cells_of_leaf(list(map(float, box[:3])), float(box[3])) for box in boxes))


def _cells_of_leaf(center, size):
    """Return all cells that a leaf covers; pruned leaves cover 8, 64 and so on."""
    side = round(size / RESOLUTION)
    first = np.rint((np.array(center) - size / 2.0) / RESOLUTION).astype(int)
    return {tuple(first + step) for step in np.ndindex(side, side, side)}
