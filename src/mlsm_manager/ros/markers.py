"""Blocks as a MarkerArray whose points are written from numpy: the bytes of genpy, without its loop over objects."""

import struct
from io import BytesIO
from typing import Dict, Iterable, List, Optional, Set, Tuple

import numpy as np
from geometry_msgs.msg import Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.surface_map.block_shapes import THINNEST, BoxList, box_lists
from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.export.colors import ColorBy, Limits, block_colors, color_limits

Tile = Tuple[int, int]
COLORS: Dict[BlockType, ColorRGBA] = {
    BlockType.HORIZONTAL: ColorRGBA(r=0.75, g=0.16, b=0.10, a=1.0),
    BlockType.VERTICAL: ColorRGBA(r=1.0, g=0.87, b=0.40, a=1.0),
}
# Four lengths of 4 bytes and the flag; behind the points follow the other three and the flag.
_EMPTY_LISTS_BYTES = 17
_AFTER_STAMP_BYTES = 16
"""Of a message: sequence, seconds, nanoseconds and the length of the frame's name."""
_OUTGROWN = 0.25
"""Share of the range of colours by which values may lie beyond it."""
_POWERS = 64
"""So many classes of boxes share a tile's number: heights from a sixteenth of a cell to 2 ** 59 cells."""


class PackedMarkerArray(MarkerArray):
    """A MarkerArray that carries its serialised form; it travels as any other and cannot be read on this side."""

    __slots__ = ["packed"]

    def __init__(self, packed: bytes) -> None:
        super().__init__()
        self.packed = packed

    def serialize(self, buff: BytesIO) -> None:
        """Write the bytes that genpy would write."""
        buff.write(self.packed)


class BlockMarkers:
    """Makes the markers of changed tiles and of the whole map; remembers what rviz may hold, to delete what is gone."""

    def __init__(self, color_by: ColorBy = ColorBy.TYPE) -> None:
        self._color_by = color_by
        self._numbers: Dict[Tile, int] = {}
        self._shown: Dict[Tile, Set[int]] = {}
        self._limits: Limits = (0.0, 0.0)

    def is_outgrown(self, blocks: Blocks) -> bool:
        """Return whether `blocks` lie so far outside of the present colours that the whole map needs new ones."""
        low, high = color_limits(blocks, self._color_by)
        margin = _OUTGROWN * (self._limits[1] - self._limits[0])
        return len(blocks) > 0 and (low < self._limits[0] - margin or high > self._limits[1] + margin)

    def changed(self, blocks: Blocks, tiles: Iterable[Tile], header: Header) -> PackedMarkerArray:
        """Return the markers of `tiles`, which hold `blocks`, and the deletion of those that are gone from them."""
        packed, now = self._packed(blocks, header)
        for tile in tiles:
            gone = self._shown.pop(tile, set()) - now.get(tile, set())
            packed += [_serialized(_marker(power, self._id(tile, power), header, Marker.DELETE)) for power in gone]
        self._shown.update(now)
        return _array(packed)

    def whole(self, blocks: Blocks, header: Header) -> PackedMarkerArray:
        """Return the markers of all blocks of the map, and the deletion of all others; colours span what they show."""
        self._limits = color_limits(blocks, self._color_by)
        return self.changed(blocks, list(self._shown), header)

    def again(self, blocks: Blocks, header: Header) -> PackedMarkerArray:
        """Return the markers of all blocks of the map, for one who knows nothing yet."""
        packed, now = self._packed(blocks, header)
        for tile, powers in now.items():
            self._shown[tile] = self._shown.get(tile, set()) | powers
        return _array(packed)

    def _packed(self, blocks: Blocks, header: Header) -> Tuple[List[bytes], Dict[Tile, Set[int]]]:
        """Return the serialised markers of blocks, and which powers there are in each tile."""
        colors = None if self._color_by is ColorBy.TYPE else _rgba(block_colors(blocks, self._color_by, self._limits))
        frames: Dict[int, _Frame] = {}
        packed, powers = [], {}
        for boxes in box_lists(blocks):
            if boxes.power not in frames:
                frames[boxes.power] = _Frame(boxes, header)
            own_colors = None if colors is None else colors[boxes.owners]
            packed.append(frames[boxes.power].filled(self._id(boxes.tile, boxes.power), boxes.centers, own_colors))
            powers.setdefault(boxes.tile, set()).add(boxes.power)
        return packed, powers

    def _id(self, tile: Tile, power: int) -> int:
        """Return a number of 31 bits that no other tile and power have."""
        return self._numbers.setdefault(tile, len(self._numbers)) * _POWERS + power - THINNEST


class _Frame:
    """The bytes of an empty CUBE_LIST of one size, into which number and cubes are put."""

    def __init__(self, boxes: BoxList, header: Header) -> None:
        marker = _marker(boxes.power, 0, header, Marker.ADD)
        marker.scale = Vector3(*boxes.size)
        data = _serialized(marker)
        number = _AFTER_STAMP_BYTES + len(header.frame_id.encode()) + 4 + len(marker.ns)
        # The message ends with five empty fields: points, colors, text, mesh and a flag.
        self._start, self._middle, self._end = data[:number], data[number + 4 : -_EMPTY_LISTS_BYTES], data[-9:]

    def filled(self, number: int, centers: np.ndarray, colors: Optional[np.ndarray]) -> bytes:
        """Return the marker `number` with cubes at `centers` (n, 3), each of its own colour where there are any."""
        points = np.ascontiguousarray(centers, dtype="<f8").tobytes()
        own = struct.pack("<I", 0) if colors is None else struct.pack("<I", len(colors)) + colors.tobytes()
        parts = [self._start, struct.pack("<i", number), self._middle, struct.pack("<I", len(centers)), points, own]
        return b"".join([*parts, self._end])


def _array(packed: List[bytes]) -> PackedMarkerArray:
    return PackedMarkerArray(struct.pack("<I", len(packed)) + b"".join(packed))


def _rgba(colors: np.ndarray) -> np.ndarray:
    return np.column_stack([colors, np.ones(len(colors))]).astype("<f4")


def _marker(power: int, number: int, header: Header, action: int) -> Marker:
    kind = BlockType.VERTICAL if power >= 0 else BlockType.HORIZONTAL
    marker = Marker(header=header, ns=kind.name.lower(), id=number, type=Marker.CUBE_LIST, action=action)
    marker.pose.orientation = Quaternion(w=1.0)
    marker.color = COLORS[kind]
    return marker


def _serialized(marker: Marker) -> bytes:
    buff = BytesIO()
    marker.serialize(buff)
    return buff.getvalue()
