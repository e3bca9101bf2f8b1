"""A map as a file: its layers, what it was made with, and where the vehicle was in it.

Of each block cell, bottom, top, number of points and crossings are kept exactly, so that points join the blocks of a
loaded map as they would have joined the saved ones. The rest is rounded: the mean to 2 ** -16 of the cell or of the
block's depth, deviations to as much of half of those, strengths to 2 ** -24 of themselves. A block takes 20 to 40
bytes.
"""

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Dict, Mapping, Optional, Sequence

import numpy as np

from georeferencing.origin import STORED, Origin
from mlsm_manager.surface_map.array_file import ArrayFileError, decoded, encoded
from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, MEAN, ROW_WIDTH, SQUARES, TOP, Blocks
from node_support.files import write_whole
from node_support.marks import Mark


class MapFileError(ValueError):
    """A file is no map that can be read, or must not be written; the text is one line and names the path."""


class ExportError(ValueError):
    """The map cannot be written in that format; the text is one line and says what to do."""


ENDING = ".mlsm"
_STEPS = 65535
_COLUMNS = {
    "x": "<i4", "y": "<i8", "within_x": "<u2", "within_y": "<u2", "bottom": "<f8", "top": "<f8", "share": "<u2",
    "deviation_x": "<u2", "deviation_y": "<u2", "deviation_z": "<u2", "strength": "<f4", "strength_deviation": "<f4",
    "count": "<u4", "crossed": "<u2",
}  # fmt: skip
"""Name and type of the columns that hold the blocks of a layer."""
_GREATEST_CELL = 2**31 - 1


class Layer(Enum):
    """What a layer of a map is for."""

    SHOWN = "shown"
    MATCHED = "matched"
    FREE = "free"


@dataclass(frozen=True)
class StoredMap:
    """All that one file holds.

    frame: of the map. layers: blocks by what they are for. calibration: parameters of sensor and vehicle that the scans
    were corrected with, by name. made: seconds since 1970, 0 when not known. arrays: anything else worth keeping with
    the map (keyframes, the vehicle's place), by name. run: which run of the graph made it, empty when not known.
    marks: places that somebody named.
    """

    frame: str
    layers: Mapping[Layer, Blocks]
    calibration: Mapping[str, Any] = field(default_factory=dict)
    made: float = 0.0
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)
    run: str = ""
    marks: Sequence[Mark] = ()

    def __len__(self) -> int:
        return sum(len(blocks) for layer, blocks in self.layers.items() if layer is not Layer.FREE)

    @property
    def origin(self) -> Optional[Origin]:
        """Where the map lies on the Earth; None where that is not known. Raises RefusedInput for a damaged one."""
        return Origin.of_array(self.arrays[STORED]) if STORED in self.arrays else None

    @property
    def shown(self) -> Blocks:
        """The blocks that tools show and export; those of the matched layer where there are no others."""
        return self.layers.get(Layer.SHOWN, self.layers.get(Layer.MATCHED, Blocks.none(1.0)))

    @property
    def free(self) -> Blocks:
        return self.layers.get(Layer.FREE, Blocks.none(self.shown.resolution))


def write_map(path: Path, stored: StoredMap) -> None:
    """Write the map whole or not at all; raises OSError."""
    write_whole(path, map_bytes(stored))


def read_map(path: Path) -> StoredMap:
    """Return the map in a file. Raises OSError, and MapFileError for a file that is no map or is damaged."""
    try:
        return map_of_bytes(path.read_bytes())
    except ArrayFileError as error:
        raise MapFileError(f"{path}: {error}") from None


def map_bytes(stored: StoredMap) -> bytes:
    words: Dict[str, Any] = {
        "frame": stored.frame,
        "made": stored.made,
        "run": stored.run,
        "calibration": dict(stored.calibration),
        "marks": [[mark.name, mark.x, mark.y, mark.z] for mark in stored.marks],
        "layers": {layer.value: _layer_words(blocks) for layer, blocks in stored.layers.items()},
    }
    arrays = {f"array/{name}": np.asarray(array) for name, array in stored.arrays.items()}
    for layer, blocks in stored.layers.items():
        columns = _columns(blocks, words["layers"][layer.value]["greatest_deviation"])
        arrays.update({f"{layer.value}/{name}": column for name, column in columns.items()})
    return encoded(words, arrays)


def map_of_bytes(data: bytes) -> StoredMap:
    """Return the map that `map_bytes` gave. Raises ArrayFileError for any other bytes."""
    words, arrays = decoded(data)
    try:
        layers = {
            Layer(name): _blocks(_named(arrays, name), float(said["resolution"]), float(said["greatest_deviation"]))
            for name, said in words["layers"].items()
        }
        frame, made, run = str(words["frame"]), float(words["made"]), str(words["run"])
        calibration = dict(words["calibration"])
        # Files of older versions have none.
        marks = [Mark(*mark) for mark in words.get("marks", [])]
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise ArrayFileError(f"holds no map ({error})") from None
    return StoredMap(frame, layers, calibration, made, _named(arrays, "array"), run, marks)


def _named(arrays: Mapping[str, np.ndarray], group: str) -> Dict[str, np.ndarray]:
    return {name[len(group) + 1 :]: array for name, array in arrays.items() if name.startswith(f"{group}/")}


def _layer_words(blocks: Blocks) -> Dict[str, float]:
    """Return resolution and the deviation in x and y [m] that the greatest step of 16 bits stands for.

    Half a cell holds all deviations of points in it; merging with a map that does not lie cell on cell can make more.
    """
    greatest = float(np.sqrt(blocks.variance[:, :2].max(initial=0.0)))
    halves = greatest / (blocks.resolution / 2.0)
    factor = 2.0 ** np.ceil(np.log2(max(halves, 1.0)) - 1e-12)
    return {"resolution": blocks.resolution, "greatest_deviation": float(factor * blocks.resolution / 2.0)}


def _columns(blocks: Blocks, greatest_deviation: float) -> Dict[str, np.ndarray]:
    order = np.lexsort((blocks.bottom, blocks.keys))
    blocks = blocks.take(order)
    cells, depth = blocks.cells, blocks.depth
    within = blocks.mean[:, :2] / blocks.resolution - cells
    share = np.divide(blocks.mean[:, 2] - blocks.bottom, depth, out=np.zeros(len(blocks)), where=depth > 0.0)
    deviation = np.sqrt(blocks.variance)
    spread = np.divide(deviation[:, 2], depth / 2.0, out=np.zeros(len(blocks)), where=depth > 0.0)
    columns = [
        np.diff(cells[:, 0], prepend=0),
        np.diff(cells[:, 1], prepend=0),
        *np.clip(np.floor(within * (_STEPS + 1)), 0, _STEPS).T,
        blocks.bottom,
        blocks.height,
        _steps(share),
        *_steps(deviation[:, :2] / greatest_deviation).T,
        _steps(spread),
        blocks.mean[:, 3],
        deviation[:, 3],
        np.minimum(blocks.count, 2**32 - 1),
        blocks.crossed,
    ]
    return {name: column.astype(kind) for (name, kind), column in zip(_COLUMNS.items(), columns)}


def _steps(shares: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(shares, 0.0, 1.0) * _STEPS)


def _blocks(columns: Mapping[str, np.ndarray], resolution: float, greatest_deviation: float) -> Blocks:
    if not (np.isfinite([resolution, greatest_deviation]).all() and resolution > 0.0 and greatest_deviation > 0.0):
        raise ValueError(f"resolution {resolution} m")
    for name, kind in _COLUMNS.items():
        if columns[name].dtype != kind or columns[name].shape != (len(columns["x"]),):
            raise ValueError(f"column {name}: {columns[name].dtype} {columns[name].shape}")
    cells = np.cumsum(np.column_stack([columns["x"], columns["y"]]).astype(np.int64), axis=0)
    if np.abs(cells).max(initial=0) > _GREATEST_CELL:
        raise ValueError("cells out of range")
    rows = np.empty((len(cells), ROW_WIDTH))
    bottom, top, count = columns["bottom"], columns["top"], columns["count"].astype(np.float64)
    within = np.column_stack([columns["within_x"], columns["within_y"]])
    # From the middle of a step: no mean comes to lie on a border, where rounding would put it into the next cell.
    rows[:, :2] = (cells + (within + 0.5) / (_STEPS + 1)) * resolution
    rows[:, 2] = np.clip(bottom + columns["share"] / _STEPS * (top - bottom), bottom, top)
    rows[:, MEAN.stop - 1] = columns["strength"]
    deviations = np.column_stack([columns[f"deviation_{axis}"] for axis in "xyz"]) / _STEPS
    deviations *= np.column_stack([np.full((len(cells), 2), greatest_deviation), (top - bottom) / 2.0])
    rows[:, SQUARES] = np.column_stack([deviations, columns["strength_deviation"]]) ** 2 * count[:, np.newaxis]
    rows[:, COUNT], rows[:, BOTTOM], rows[:, TOP] = count, bottom, top
    if not np.isfinite(rows).all() or (count < 1.0).any() or (bottom > top).any():
        raise ValueError("blocks that are not finite, without points, or with bottom above top")
    return Blocks(rows, resolution, columns["crossed"])
