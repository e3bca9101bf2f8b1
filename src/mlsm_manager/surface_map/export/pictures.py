"""Maps for the eye: colours of blocks, a picture from above, and a window in which blocks can be turned."""

import os
from enum import Enum
from io import BytesIO
from pathlib import Path
from typing import Callable, Dict, Optional, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.boxes import THINNEST
from mlsm_manager.surface_map.export.rasters import box_around
from mlsm_manager.surface_map.map_file import ExportError
from node_support.errors import needed
from node_support.files import write_whole

Limits = Tuple[float, float]
TYPE_COLORS = {BlockType.HORIZONTAL: (0.75, 0.16, 0.10), BlockType.VERTICAL: (1.0, 0.87, 0.40)}
_RAMP = np.array(
    [[0.19, 0.07, 0.23], [0.27, 0.52, 0.97], [0.10, 0.89, 0.71],
     [0.64, 0.99, 0.24], [0.98, 0.73, 0.22], [0.79, 0.16, 0.00]]
)  # fmt: skip
"""From low to high, six points of the colour map "turbo" (Mikhailov 2019), whose steps the eye tells apart."""
_INNER_SHARE = (2.0, 98.0)  # percent: a few echoes far off do not take the colours from all others
_FREE_COLOR = (0.91, 0.95, 0.98)
_WIDTH_INCHES = 10.0
_DPI = 150
_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_TRIANGLES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


class ColorBy(Enum):
    """What blocks are coloured by."""

    TYPE = "TYPE"
    HEIGHT = "HEIGHT"
    STRENGTH = "STRENGTH"
    AGE = "AGE"
    COUNT = "COUNT"


_VALUES: Dict[ColorBy, Tuple[str, Callable[[Blocks], np.ndarray]]] = {
    ColorBy.HEIGHT: ("highest point [m]", lambda blocks: blocks.height),
    ColorBy.STRENGTH: ("strength", lambda blocks: blocks.mean[:, 3]),
    ColorBy.AGE: ("beams since it was heard", lambda blocks: blocks.crossed),
    ColorBy.COUNT: ("points", lambda blocks: blocks.count),
}


def block_colors(blocks: Blocks, by: ColorBy, limits: Optional[Limits] = None) -> np.ndarray:
    """Return (n, 3) red, green and blue from 0 to 1; `limits` are the values of the lowest and the highest colour.

    The age of a block is the number of beams that crossed it since a point last fell into it.
    """
    if by is ColorBy.TYPE:
        return np.array(list(TYPE_COLORS.values()))[blocks.type]
    low, high = limits or color_limits(blocks, by)
    return ramp((_VALUES[by][1](blocks) - low) / (high - low) if high > low else np.zeros(len(blocks)))


def color_limits(blocks: Blocks, by: ColorBy) -> Limits:
    """Return the values between which nearly all of the blocks lie; 0 and 0 without blocks, or for types."""
    if by is ColorBy.TYPE or not len(blocks):
        return 0.0, 0.0
    low, high = np.percentile(_VALUES[by][1](blocks), _INNER_SHARE)
    return float(low), float(high)


def ramp(shares: np.ndarray) -> np.ndarray:
    """Return (n, 3) colours of shares (n,), those outside 0 to 1 as the nearest end."""
    places = np.linspace(0.0, 1.0, len(_RAMP))
    return np.column_stack([np.interp(shares, places, _RAMP[:, channel]) for channel in range(3)])


def write_picture(path: Path, blocks: Blocks, free: Blocks, color_by: ColorBy) -> None:
    """Write a PNG of the highest block of each cell on what is free, y up, with what its colours mean.

    Where the map is flat, its heights are rounding, and the number of points is shown instead. Raises ExportError and
    OSError.
    """
    # matplotlib takes half a second and 40 MB: only who draws a picture shall pay for it.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize
    from matplotlib.figure import Figure

    if color_by is ColorBy.HEIGHT and blocks.is_flat:
        color_by = ColorBy.COUNT
    pixels, (left, bottom) = _pixels(blocks, free, color_by)
    rows, columns = pixels.shape[:2]
    extent = (left, left + columns * blocks.resolution, bottom, bottom + rows * blocks.resolution)
    figure = Figure(figsize=(_WIDTH_INCHES, np.clip(_WIDTH_INCHES * rows / max(columns, 1), 3.0, 30.0)), dpi=_DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(1, 1, 1)
    axes.imshow(pixels, origin="lower", extent=extent, interpolation="nearest")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    if color_by is not ColorBy.TYPE:
        colors = LinearSegmentedColormap.from_list("turbo", _RAMP)
        shown = ScalarMappable(Normalize(*color_limits(blocks, color_by)), colors)
        shown.set_array(np.empty(0))
        figure.colorbar(shown, ax=axes, label=_VALUES[color_by][0], shrink=0.6)
    picture = BytesIO()
    figure.savefig(picture, format="png", bbox_inches="tight")
    write_whole(path, picture.getvalue())


def _pixels(blocks: Blocks, free: Blocks, color_by: ColorBy) -> Tuple[np.ndarray, np.ndarray]:
    """Return (rows, columns, 3) colours, and the lower left corner (2,) m."""
    low, shape = box_around(np.concatenate([free.cells, blocks.cells]))
    pixels = np.ones((*shape, 3))
    pixels[tuple((free.cells - low).T[::-1])] = _FREE_COLOR
    order = np.argsort(blocks.height, kind="stable")
    pixels[tuple((blocks.cells[order] - low).T[::-1])] = block_colors(blocks, color_by)[order]
    return pixels, low * blocks.resolution


def has_screen() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def box_mesh(blocks: Blocks) -> tuple:
    """Return the corners (8 n, 3) m and triangles (12 n, 3) of boxes as large as the blocks (n)."""
    low = np.column_stack([blocks.cells * blocks.resolution, blocks.bottom])
    side = np.full((len(blocks), 2), blocks.resolution)
    size = np.column_stack([side, np.maximum(blocks.depth, 2.0**THINNEST * blocks.resolution)])
    corners = low[:, np.newaxis] + _CORNERS * size[:, np.newaxis]
    triangles = np.arange(len(blocks))[:, np.newaxis, np.newaxis] * len(_CORNERS) + _TRIANGLES
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def show(blocks: Blocks, title: str, color_by: ColorBy) -> None:
    """Open the window and return when it is closed. Raises ExportError without Open3D."""
    open3d = needed("open3d", "apt install python3-open3d", ExportError)
    corners, triangles = box_mesh(blocks)
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(corners), open3d.utility.Vector3iVector(triangles.astype(np.int32))
    )
    colors = np.repeat(block_colors(blocks, color_by), len(_CORNERS), axis=0)
    mesh.vertex_colors = open3d.utility.Vector3dVector(colors)
    mesh.compute_vertex_normals()
    open3d.visualization.draw_geometries([mesh], window_name=title)
