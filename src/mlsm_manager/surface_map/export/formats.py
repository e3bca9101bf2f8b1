"""Maps in the formats of other programs: the ending of a file's name says which."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Dict, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.charts import write_geotiff
from mlsm_manager.surface_map.export.pictures import ColorBy, write_picture
from mlsm_manager.surface_map.export.rasters import elevation, occupancy, write_ascii_grid, write_map_server
from mlsm_manager.surface_map.map_file import ENDING, ExportError, StoredMap, write_map
from node_support.errors import needed
from node_support.files import whole_file, write_whole
from node_support.geometry import members

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
    open3d = needed("open3d", "apt install python3-open3d", ExportError)
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
    EPSG:25831; the one that suits where it is empty.
    """

    low: float = -np.inf
    high: float = np.inf
    color_by: ColorBy = ColorBy.HEIGHT
    crs: str = ""


_WRITERS: Dict[str, Callable[[Path, StoredMap, ExportOptions], None]] = {
    ".ply": lambda path, stored, _: write_ply(path, stored.shown),
    ".pcd": lambda path, stored, _: write_pcd(path, stored.shown),
    ".bt": lambda path, stored, _: write_octree(path, stored.shown, stored.free),
    ".ot": lambda path, stored, _: write_octree(path, stored.shown, stored.free),
    ".pgm": lambda path, stored, options: write_map_server(
        path, occupancy(stored.shown, stored.free, options.low, options.high)
    ),
    GEOTIFF: lambda path, stored, options: write_geotiff(path, stored.shown, stored.origin, options.crs),
    ".asc": lambda path, stored, _: write_ascii_grid(path, elevation(stored.shown)),
    ".png": lambda path, stored, options: write_picture(path, stored.shown, stored.free, options.color_by),
    ENDING: lambda path, stored, _: write_map(path, stored),
}
ENDINGS = tuple(_WRITERS)


def export(stored: StoredMap, path: Path, options: ExportOptions) -> None:
    """Write the map in the format of the path's ending, whole or not at all.

    Raises ExportError for an ending that is none of ENDINGS, for an empty map in other formats than this package's, and
    for what a format cannot hold; OSError.
    """
    if path.suffix not in ENDINGS:
        raise ExportError(f"{path}: must end with one of {' '.join(ENDINGS)}")
    if path.suffix != ENDING and not len(stored):
        raise ExportError("the map has no blocks")
    _WRITERS[path.suffix](path, stored, options)


_HIT, _MISS = 0.85, -0.4  # log-odds of one hit and one miss, OctoMap's own (probabilities 0.7 and 0.4)
_MOST_HITS, _MOST_MISSES = 5, 5  # more change nothing: OctoMap keeps log-odds between -2 and 3.5
_HALF_TREE = 32768  # an OcTree has 16 levels: so many cells to each side of the origin
_MOST_VOXELS = 100_000_000  # a tree of more takes gigabytes; one tall block of noise can ask for that


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
    owners, rank = members(number)
    voxels = np.column_stack([blocks.cells[owners], first[owners] + rank])
    if not (voxels.min(initial=0) >= -_HALF_TREE and voxels.max(initial=0) < _HALF_TREE):
        reach = _HALF_TREE * blocks.resolution
        raise ExportError(f"reaches beyond {reach:g} m, the end of an OcTree of this resolution; crop the map first")
    return voxels, owners


def _empty_tree(resolution: float) -> Any:
    try:
        import pyoctomap
    except ImportError:
        raise ExportError("needs pyoctomap; install it with: pip install pyoctomap") from None
    except ValueError as error:
        raise ExportError(f"pyoctomap does not load with numpy {np.__version__}; use a newer one: {error}") from error
    return pyoctomap.OcTree(resolution)
