"""Maps as PLY files: every block one vertex with all it holds, readable by any point cloud tool."""

import os
import tempfile
from pathlib import Path

import numpy as np

from mlsm_manager.blocks import Blocks

_FIELDS = (
    ("x", "f8"), ("y", "f8"), ("z", "f8"), ("intensity", "f8"),
    ("variance_x", "f8"), ("variance_y", "f8"), ("variance_z", "f8"), ("variance_intensity", "f8"),
    ("bottom", "f8"), ("height", "f8"), ("count", "u4"), ("type", "u1"),
)  # fmt: skip
_PLY_TYPES = {"f8": "double", "u4": "uint", "u1": "uchar"}


def map_path(folder: str, name: str) -> Path:
    """Return where the map `name` is kept in `folder`; raises ValueError for a name that would leave the folder."""
    if not name or name.startswith(".") or Path(name).name != name or "\0" in name:
        raise ValueError(f"name {name!r}: must be a plain file name without a path and not start with a dot")
    return Path(folder).expanduser() / (name if name.endswith(".ply") else f"{name}.ply")


def write_ply(path: Path, blocks: Blocks) -> None:
    """Write the blocks whole or not at all; raises OSError when the folder cannot be written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=str(path.parent), prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(_header(blocks).encode("ascii") + _vertices(blocks).tobytes())
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, str(path))
    except BaseException:
        os.unlink(temporary)
        raise


def _header(blocks: Blocks) -> str:
    properties = "".join(f"property {_PLY_TYPES[kind]} {name}\n" for name, kind in _FIELDS)
    comment = f"comment multi level surface map, resolution {blocks.resolution!r} m\n"
    return f"ply\nformat binary_little_endian 1.0\n{comment}element vertex {len(blocks)}\n{properties}end_header\n"


def _vertices(blocks: Blocks) -> np.ndarray:
    columns = [*blocks.mean.T, *blocks.variance.T, blocks.bottom, blocks.height, blocks.count, blocks.type]
    vertices = np.empty(len(blocks), dtype=[(name, f"<{kind}") for name, kind in _FIELDS])
    for (name, _), column in zip(_FIELDS, columns):
        vertices[name] = column
    return vertices
