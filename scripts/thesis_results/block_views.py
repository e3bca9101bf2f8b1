"""Draws the blocks of a map, from above and as boxes in space."""

from typing import List, Tuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from mlsm_manager.surface_map.blocks import Blocks, BlockType

COLOURS = {BlockType.HORIZONTAL: (0.72, 0.15, 0.12), BlockType.VERTICAL: (0.98, 0.87, 0.50)}
"""The thesis's: red, and light yellow for vertical blocks."""
_LEAST_HEIGHT = 0.08  # m: a block of one point is drawn this high
_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
# Brightness of the top and of the sides that look to -x and to -y.
_SHADES = (1.0, 0.82, 0.66)


def draw_in_space(axes: Axes, blocks: Blocks, direction: float, elevation: float) -> None:
    """Draw blocks as boxes in parallel projection, as seen from `direction` and `elevation` [rad].

    Boxes on a grid do not cut each other: drawn from far to near, each hides what is behind it.
    """
    towards = np.array(
        [np.cos(direction) * np.cos(elevation), np.sin(direction) * np.cos(elevation), np.sin(elevation)]
    )
    right = np.array([-np.sin(direction), np.cos(direction), 0.0])
    up = np.cross(towards, right)
    faces, colours = _faces(blocks, towards)
    order = np.argsort(np.einsum("nki,i->n", faces, towards), kind="stable")
    flat = np.stack([faces @ right, faces @ up], axis=-1)[order]
    axes.add_collection(
        PolyCollection(flat, facecolors=colours[order], edgecolors=colours[order] * 0.7, linewidths=0.2)
    )
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()


def _faces(blocks: Blocks, towards: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the visible faces (n, 4, 3) and their colours (n, 3)."""
    size = blocks.resolution
    low = blocks.centers - size / 2.0
    bottom, top = blocks.bottom, np.maximum(blocks.height, blocks.bottom + _LEAST_HEIGHT)
    base = np.array([COLOURS[BlockType(int(kind))] for kind in blocks.type])
    plan = low[:, np.newaxis] + _CORNERS * size
    faces: List[np.ndarray] = [_at_height(plan, top)]
    for axis in (0, 1):
        side = low.copy()
        side[:, axis] += size if towards[axis] > 0 else 0.0
        other = np.zeros(2)
        other[1 - axis] = size
        edge = np.stack([side, side + other], axis=1)
        faces.append(np.concatenate([_at_height(edge, bottom), _at_height(edge, top)[:, ::-1]], axis=1))
    return np.concatenate(faces), np.concatenate([base * shade for shade in _SHADES])


def _at_height(plan: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return places (n, k, 3) of places (n, k, 2) seen from above."""
    return np.concatenate([plan, np.broadcast_to(heights[:, np.newaxis, np.newaxis], (*plan.shape[:2], 1))], axis=2)


def draw_from_above(axes: Axes, blocks: Blocks, alpha: float = 1.0) -> None:
    """Draw the cells of blocks, vertical ones on top."""
    order = np.argsort(blocks.type, kind="stable")
    plan = (blocks.centers - blocks.resolution / 2.0)[order, np.newaxis] + _CORNERS * blocks.resolution
    colours = np.array([COLOURS[BlockType(int(kind))] for kind in blocks.type[order]]).reshape(-1, 3)
    axes.add_collection(PolyCollection(plan, facecolors=colours, linewidths=0, alpha=alpha))
    axes.autoscale_view()
