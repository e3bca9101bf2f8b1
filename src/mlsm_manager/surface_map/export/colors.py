"""What the colour of a block can tell."""

from enum import Enum
from typing import Optional, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType

_TYPE_COLORS = {
    BlockType.HORIZONTAL: (0.75, 0.16, 0.10),
    BlockType.VERTICAL: (1.0, 0.87, 0.40),
}
_RAMP = np.array(
    [
        (0.19, 0.07, 0.23),
        (0.27, 0.52, 0.97),
        (0.10, 0.89, 0.71),
        (0.64, 0.99, 0.24),
        (0.98, 0.73, 0.22),
        (0.79, 0.16, 0.0),
    ]
)
"""From low to high, six points of the colour map "turbo" (Mikhailov 2019), whose steps the eye tells apart."""
_INNER_SHARE = (2.0, 98.0)
"""Percent: a few echoes far off do not take the colours from all others."""

Limits = Tuple[float, float]


class ColorBy(Enum):
    """What blocks are coloured by."""

    TYPE = "TYPE"
    HEIGHT = "HEIGHT"
    STRENGTH = "STRENGTH"
    AGE = "AGE"


def block_colors(blocks: Blocks, by: ColorBy, limits: Optional[Limits] = None) -> np.ndarray:
    """Return (n, 3) red, green and blue from 0 to 1; `limits` are the values of the lowest and the highest colour.

    The age of a block is the number of beams that crossed it since a point last fell into it.
    """
    if by is ColorBy.TYPE:
        return np.array([_TYPE_COLORS[kind] for kind in BlockType if kind in _TYPE_COLORS])[blocks.type]
    low, high = limits or color_limits(blocks, by)
    return ramp((_values(blocks, by) - low) / (high - low) if high > low else np.zeros(len(blocks)))


def color_limits(blocks: Blocks, by: ColorBy) -> Limits:
    """Return the values between which nearly all of the blocks lie; 0 and 0 without blocks, or for types."""
    if by is ColorBy.TYPE or not len(blocks):
        return 0.0, 0.0
    low, high = np.percentile(_values(blocks, by), _INNER_SHARE)
    return float(low), float(high)


def _values(blocks: Blocks, by: ColorBy) -> np.ndarray:
    return {ColorBy.HEIGHT: blocks.height, ColorBy.STRENGTH: blocks.mean[:, 3], ColorBy.AGE: blocks.crossed}[by]


def ramp(shares: np.ndarray) -> np.ndarray:
    """Return (n, 3) colours of shares (n,), those outside 0 to 1 as the nearest end."""
    places = np.linspace(0.0, 1.0, len(_RAMP))
    return np.column_stack([np.interp(shares, places, _RAMP[:, channel]) for channel in range(3)])
