"""Open3D's window: the blocks of a map as boxes that can be turned."""

import os

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.colors import ColorBy, block_colors
from mlsm_manager.surface_map.export.errors import ExportError

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_TRIANGLES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
_THINNEST = 1.0 / 16.0
"""Of a cell: flat blocks are drawn that thick."""


def has_screen() -> bool:
    """Return whether there is a screen to open a window on."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def box_mesh(blocks: Blocks) -> tuple:
    """Return the corners (8 n, 3) m and triangles (12 n, 3) of boxes as large as the blocks (n)."""
    low = np.column_stack([blocks.cells * blocks.resolution, blocks.bottom])
    side = np.full((len(blocks), 2), blocks.resolution)
    size = np.column_stack([side, np.maximum(blocks.depth, _THINNEST * blocks.resolution)])
    corners = low[:, np.newaxis] + _CORNERS * size[:, np.newaxis]
    triangles = np.arange(len(blocks))[:, np.newaxis, np.newaxis] * len(_CORNERS) + _TRIANGLES
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def show(blocks: Blocks, title: str, color_by: ColorBy) -> None:
    """Open the window and return when it is closed. Raises ExportError without Open3D."""
    try:
        import open3d
    except ImportError:
        raise ExportError("needs Open3D; install it with: apt install python3-open3d") from None
    corners, triangles = box_mesh(blocks)
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(corners), open3d.utility.Vector3iVector(triangles.astype(np.int32))
    )
    colors = np.repeat(block_colors(blocks, color_by), len(_CORNERS), axis=0)
    mesh.vertex_colors = open3d.utility.Vector3dVector(colors)
    mesh.compute_vertex_normals()
    open3d.visualization.draw_geometries([mesh], window_name=title)
