"""A map as a picture: top view, to scale, with a scale bar."""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.colors import ColorBy, block_colors
from mlsm_manager.surface_map.export.rasters import elevation
from node_support.files import write_whole

_FREE_COLOR = (0.91, 0.95, 0.98)
_WIDTH_INCHES = 10.0
_DPI = 150
_BAR_SHARE = 0.25


def write_picture(path: Path, blocks: Blocks, free: Blocks, color_by: ColorBy = ColorBy.HEIGHT) -> None:
    """Write a PNG of the highest block of each cell on what is free, north up; raises ExportError and OSError."""
    pixels, origin, resolution = _pixels(blocks, free, color_by)
    rows, columns = pixels.shape[:2]
    extent = (origin[0], origin[0] + columns * resolution, origin[1], origin[1] + rows * resolution)
    figure = Figure(figsize=(_WIDTH_INCHES, np.clip(_WIDTH_INCHES * rows / max(columns, 1), 3.0, 30.0)), dpi=_DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(1, 1, 1)
    axes.imshow(pixels, origin="lower", extent=extent, interpolation="nearest")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    length = bar_length(columns * resolution)
    axes.add_artist(AnchoredSizeBar(axes.transData, length, f"{length:g} m", loc="lower right", size_vertical=0))
    picture = BytesIO()
    figure.savefig(picture, format="png", bbox_inches="tight")
    write_whole(path, picture.getvalue())


def bar_length(width: float) -> float:
    """Return the length [m] of a scale bar for a picture `width` [m] wide: 1, 2 or 5 times a power of ten."""
    wanted = max(width * _BAR_SHARE, 1e-3)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1.0 + 1e-9)) * power)


def _pixels(blocks: Blocks, free: Blocks, color_by: ColorBy) -> tuple:
    """Return (rows, columns, 3) colours, the origin (2,) m and the resolution, m."""
    both = Blocks(np.concatenate([free.rows, blocks.rows]), blocks.resolution)
    raster = elevation(both)
    pixels = np.ones((*raster.values.shape, 3))
    low = np.rint(raster.origin / raster.resolution).astype(np.int64)
    pixels[tuple((free.cells - low).T[::-1])] = _FREE_COLOR
    order = np.argsort(blocks.height, kind="stable")
    pixels[tuple((blocks.cells[order] - low).T[::-1])] = block_colors(blocks, color_by)[order]
    return pixels, raster.origin, raster.resolution
