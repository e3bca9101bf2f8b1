"""Maps in the formats of other programs: the ending of a file's name says which."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Callable, Dict, Optional

import numpy as np

from georeferencing.origin import Origin
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.charts import write_geotiff
from mlsm_manager.surface_map.export.octomap import write_octree
from mlsm_manager.surface_map.export.pictures import ColorBy, write_picture
from mlsm_manager.surface_map.export.rasters import elevation, occupancy, write_ascii_grid, write_map_server
from mlsm_manager.surface_map.map_file import ENDING, ExportError, Layer, StoredMap, write_map
from node_support.files import whole_file, write_whole

GEOTIFF = ".tif"
_PLY_TYPES = {"f8": "double", "u4": "uint", "u1": "uchar"}


def write_ply(path: Path, blocks: Blocks) -> None:
    """Write a binary PLY: x y z of each block's mean, intensity, variances, bottom, height, count and type.

    Raises OSError.
    """
    axes = ("x", "y", "z", "intensity")
    columns = {**dict(zip(axes, blocks.mean.T)), **dict(zip((f"variance_{axis}" for axis in axes), blocks.variance.T))}
    columns.update(bottom=blocks.bottom, height=blocks.height, count=blocks.count, type=blocks.type)
    kinds = {name: {"count": "u4", "type": "u1"}.get(name, "f8") for name in columns}
    vertices = np.empty(len(blocks), dtype=[(name, f"<{kind}") for name, kind in kinds.items()])
    for name, column in columns.items():
        vertices[name] = column
    lines = [
        "ply", "format binary_little_endian 1.0",
        f"comment multi level surface map, resolution {blocks.resolution!r} m", f"element vertex {len(blocks)}",
        *(f"property {_PLY_TYPES[kind]} {name}" for name, kind in kinds.items()), "end_header\n",
    ]  # fmt: skip
    write_whole(path, "\n".join(lines).encode("ascii") + vertices.tobytes())


def write_pcd(path: Path, blocks: Blocks) -> None:
    """Write a binary PCD with what `write_ply` writes, in float32. Raises ExportError without Open3D, and OSError."""
    try:
        import open3d
    except ImportError:
        raise ExportError("needs Open3D; install it with: apt install python3-open3d") from None
    fields = {"intensity": blocks.mean[:, 3], "bottom": blocks.bottom, "height": blocks.height}
    fields.update(
        {f"variance_{axis}": blocks.variance[:, index] for index, axis in enumerate(("x", "y", "z", "intensity"))}
    )
    columns = {name: column.astype(np.float32) for name, column in fields.items()}
    columns.update(count=blocks.count.astype(np.uint32), type=blocks.type.astype(np.uint8))
    cloud = open3d.t.geometry.PointCloud()
    cloud.point["positions"] = open3d.core.Tensor(blocks.mean[:, :3].astype(np.float32))
    for name, column in columns.items():
        cloud.point[name] = open3d.core.Tensor(np.ascontiguousarray(column[:, np.newaxis]))
    # Open3D tells the format by the ending, which the temporary file does not have.
    with whole_file(path) as temporary:
        named = temporary.with_name(temporary.name + path.suffix)
        try:
            if not open3d.t.io.write_point_cloud(str(named), cloud, write_ascii=False):
                raise ExportError(f"{path}: Open3D could not write it")
            named.replace(temporary)
        finally:
            if named.exists():
                named.unlink()


@dataclass(frozen=True)
class ExportOptions:
    """low, high: m, of the slice that a 2-D occupancy grid shows. color_by: of a picture. crs: of a GeoTIFF, such as
    EPSG:25831; the one that suits where it is empty. origin: where the map lies, where that is known.
    """

    low: float = -np.inf
    high: float = np.inf
    color_by: ColorBy = ColorBy.HEIGHT
    crs: str = ""
    origin: Optional[Origin] = None


_Writer = Callable[[Path, Blocks, Blocks, ExportOptions], None]
_WRITERS: Dict[str, _Writer] = {
    ".ply": lambda path, blocks, free, options: write_ply(path, blocks),
    ".pcd": lambda path, blocks, free, options: write_pcd(path, blocks),
    ".bt": lambda path, blocks, free, options: write_octree(path, blocks, free),
    ".ot": lambda path, blocks, free, options: write_octree(path, blocks, free),
    ".pgm": lambda path, blocks, free, options: write_map_server(
        path, occupancy(blocks, free, options.low, options.high)
    ),
    GEOTIFF: lambda path, blocks, free, options: write_geotiff(path, blocks, options.origin, options.crs),
    ".asc": lambda path, blocks, free, options: write_ascii_grid(path, elevation(blocks)),
    ".png": lambda path, blocks, free, options: write_picture(path, blocks, free, options.color_by),
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
    free = stored.layers.get(Layer.FREE, Blocks.none(blocks.resolution))
    _WRITERS[path.suffix](path, blocks, free, replace(options, origin=stored.origin))
