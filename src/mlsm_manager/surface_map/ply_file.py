"""Maps as PLY files: every block one vertex with all it holds, readable by any point cloud tool."""

import math
import re
from pathlib import Path

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, MEAN, ROW_WIDTH, SQUARES, TOP, Blocks, BlockType
from node_support.files import write_whole

_FIELDS = (
    ("x", "f8"), ("y", "f8"), ("z", "f8"), ("intensity", "f8"),
    ("variance_x", "f8"), ("variance_y", "f8"), ("variance_z", "f8"), ("variance_intensity", "f8"),
    ("bottom", "f8"), ("height", "f8"), ("count", "u4"), ("type", "u1"),
)  # fmt: skip
_PLY_TYPES = {"f8": "double", "u4": "uint", "u1": "uchar"}
_ROW = np.dtype([(name, f"<{kind}") for name, kind in _FIELDS])
_HEADER = re.compile(
    rb"ply\nformat binary_little_endian 1\.0\ncomment multi level surface map, resolution (?P<resolution>\S+) m\n"
    rb"element vertex (?P<count>\d+)\n(?P<properties>(?:property .*\n)*)end_header\n"
)
_ROUNDING = 1e-6  # of a mean, which is summed up from many points and may leave its bottom and top by rounding alone


def write_ply(path: Path, blocks: Blocks) -> None:
    """Write the blocks whole or not at all; raises OSError when the folder cannot be written."""
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment multi level surface map, resolution {blocks.resolution!r} m\n"
    )
    header += f"element vertex {len(blocks)}\n{_properties()}end_header\n"
    columns = [*blocks.mean.T, *blocks.variance.T, blocks.bottom, blocks.height, blocks.count, blocks.type]
    vertices = np.empty(len(blocks), dtype=_ROW)
    for (name, _), column in zip(_FIELDS, columns):
        vertices[name] = column
    write_whole(path, header.encode("ascii") + vertices.tobytes())


def read_ply(path: Path) -> Blocks:
    """Return the blocks of a file that `write_ply` wrote.

    Raises ValueError, naming the path, for any other file and for blocks that no map can hold. OSError as Path does.
    """
    data = path.read_bytes()
    match = _HEADER.match(data)
    if match is None:
        raise ValueError(f"{path}: not a map of this package")
    resolution, count = _resolution(path, match.group("resolution")), int(match.group("count"))
    body = data[match.end() :]
    if match.group("properties") != _properties().encode("ascii") or len(body) != count * _ROW.itemsize:
        raise ValueError(f"{path}: a map of another version, or cut short")
    vertices = np.frombuffer(body, dtype=_ROW)
    _check(path, vertices)
    rows = np.empty((count, ROW_WIDTH))
    for index, axis in enumerate(("x", "y", "z", "intensity")):
        rows[:, MEAN.start + index] = vertices[axis]
        rows[:, SQUARES.start + index] = vertices[f"variance_{axis}"] * vertices["count"]
    rows[:, COUNT], rows[:, BOTTOM], rows[:, TOP] = vertices["count"], vertices["bottom"], vertices["height"]
    return Blocks(rows, resolution)


def _resolution(path: Path, text: bytes) -> float:
    try:
        resolution = float(text)
    except ValueError:
        resolution = math.nan
    if not 0.0 < resolution < math.inf:
        raise ValueError(f"{path}: resolution {text.decode('ascii', 'replace')} m: must be finite and above 0")
    return resolution


def _check(path: Path, vertices: np.ndarray) -> None:
    doubles = np.array([vertices[name] for name, kind in _FIELDS if kind == "f8"])
    variances = np.array([vertices[name] for name, _ in _FIELDS if name.startswith("variance_")])
    slack = _ROUNDING * np.maximum(np.abs(vertices["z"]), 1.0)
    inside = (vertices["z"] >= vertices["bottom"] - slack) & (vertices["z"] <= vertices["height"] + slack)
    requirements = (
        ("values that are not finite", np.isfinite(doubles).all(axis=0)),
        ("no points", vertices["count"] > 0),
        ("a negative variance", (variances >= 0.0).all(axis=0)),
        ("a mean height that is not between bottom and top", inside),
        ("an unknown type", np.isin(vertices["type"], [int(kind) for kind in BlockType])),
    )
    for fault, holds in requirements:
        if not holds.all():
            raise ValueError(f"{path}: {np.count_nonzero(~holds)} of {len(holds)} blocks have {fault}; it is damaged")


def _properties() -> str:
    return "".join(f"property {_PLY_TYPES[kind]} {name}\n" for name, kind in _FIELDS)
