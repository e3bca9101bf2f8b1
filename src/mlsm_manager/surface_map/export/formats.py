"""Which format the ending of a file's name asks for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict

import numpy as np

from mlsm_manager.surface_map.blocks import ROW_WIDTH, Blocks
from mlsm_manager.surface_map.export.clouds import write_pcd
from mlsm_manager.surface_map.export.colors import ColorBy
from mlsm_manager.surface_map.export.errors import ExportError
from mlsm_manager.surface_map.export.octomap import write_octree
from mlsm_manager.surface_map.export.raster_files import write_ascii_grid, write_geotiff, write_map_server
from mlsm_manager.surface_map.export.rasters import elevation, occupancy
from mlsm_manager.surface_map.files.map_file import ENDING, Layer, StoredMap, write_map
from mlsm_manager.surface_map.storage import write_ply


@dataclass(frozen=True)
class ExportOptions:
    """low, high: m, of the slice that a 2-D occupancy grid shows. color_by: of a picture."""

    low: float = -np.inf
    high: float = np.inf
    color_by: ColorBy = ColorBy.HEIGHT


def _write_png(path: Path, blocks: Blocks, free: Blocks, options: ExportOptions) -> None:
    # matplotlib takes half a second and 40 MB: only who draws a picture shall pay for it.
    from mlsm_manager.surface_map.export.picture import write_picture

    write_picture(path, blocks, free, options.color_by)


_Writer = Callable[[Path, Blocks, Blocks, ExportOptions], None]
_WRITERS: Dict[str, _Writer] = {
    ".ply": lambda path, blocks, free, options: write_ply(path, blocks),
    ".pcd": lambda path, blocks, free, options: write_pcd(path, blocks),
    ".bt": lambda path, blocks, free, options: write_octree(path, blocks, free),
    ".ot": lambda path, blocks, free, options: write_octree(path, blocks, free),
    ".pgm": lambda path, blocks, free, options: write_map_server(
        path, occupancy(blocks, free, options.low, options.high)
    ),
    ".tif": lambda path, blocks, free, options: write_geotiff(path, elevation(blocks)),
    ".asc": lambda path, blocks, free, options: write_ascii_grid(path, elevation(blocks)),
    ".png": _write_png,
}
ENDINGS = (*_WRITERS, ENDING)


def export(stored: StoredMap, path: Path, options: ExportOptions) -> None:
    """Write the map in the format of the path's ending, whole or not at all.

    Raises ExportError for an ending that is none of ENDINGS, for an empty map in other formats than this package's, and
    for what a format cannot hold; OSError.
    """
    if path.suffix not in ENDINGS:
        raise ExportError(f"{path}: must end with one of {' '.join(ENDINGS)}")
    if path.suffix == ENDING:
        write_map(path, stored)
        return
    if not len(stored):
        raise ExportError("the map has no blocks")
    blocks = stored.shown
    free = stored.layers.get(Layer.FREE, Blocks(np.empty((0, ROW_WIDTH)), blocks.resolution))
    _WRITERS[path.suffix](path, blocks, free, options)
