"""Maps as point clouds with all that blocks hold, through Open3D."""

from pathlib import Path

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.errors import ExportError
from node_support.files import whole_file


def write_pcd(path: Path, blocks: Blocks) -> None:
    """Write a binary PCD, float32: x y z of each block's mean, intensity, variances, bottom, height, count and type.

    Raises ExportError without Open3D, and OSError.
    """
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
