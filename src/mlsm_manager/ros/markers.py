"""Blocks as a MarkerArray whose points are written from numpy: the bytes of genpy, without its loop over objects."""

import struct
from io import BytesIO
from typing import Dict, Iterable, Iterator, List, Tuple

import numpy as np
from geometry_msgs.msg import Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.boxes import THINNEST, BoxLists, box_lists, box_size, box_type
from mlsm_manager.surface_map.export.pictures import TYPE_COLORS, ColorBy, Limits, block_colors, color_limits

Tile = Tuple[int, int]
COLORS = {kind: ColorRGBA(*color, 1.0) for kind, color in TYPE_COLORS.items()}
# Four lengths of 4 bytes and the flag; behind the points follow the other three and the flag.
_EMPTY_LISTS_BYTES = 17
_NO_COLORS = struct.pack("<I", 0)
_POINT_BYTES, _COLOR_BYTES = 24, 16  # three float64 and four float32
_AFTER_STAMP_BYTES = 16  # of a message: sequence, seconds, nanoseconds and the length of the frame's name
_OUTGROWN = 0.25  # share of the range of colours by which values may lie beyond it
_POWERS = 64  # so many classes of boxes share a tile's number: heights from a sixteenth of a cell to 2 ** 59 cells


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
        self._shown: Dict[Tile, int] = {}
        """The classes of boxes in each tile, one bit each, from THINNEST on."""
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
            gone = self._shown.pop(tile, 0) & ~now.get(tile, 0)
            for kind in (kind for kind in range(gone.bit_length()) if gone >> kind & 1):
                packed.append(_serialized(_marker(kind + THINNEST, self._id(tile, kind), header, Marker.DELETE)))
        self._shown.update(now)
        return _array(packed)

    def whole(self, blocks: Blocks, header: Header) -> PackedMarkerArray:
        """Return the markers of all blocks of the map, and the deletion of all others; colours span what they show."""
        self._limits = color_limits(blocks, self._color_by)
        return self.changed(blocks, list(self._shown), header)

    def again(self, blocks: Blocks, header: Header) -> PackedMarkerArray:
        """Return the markers of all blocks of the map, for one who knows nothing yet."""
        packed, now = self._packed(blocks, header)
        for tile, kinds in now.items():
            self._shown[tile] = self._shown.get(tile, 0) | kinds
        return _array(packed)

    def _packed(self, blocks: Blocks, header: Header) -> Tuple[List[bytes], Dict[Tile, int]]:
        """Return the serialised markers of blocks, and which classes of boxes there are in each tile."""
        boxes = box_lists(blocks)
        cubes, powers = self._cubes(boxes, blocks), boxes.powers.tolist()
        frames = {power: _Frame(power, boxes.resolution, header) for power in set(powers)}
        packed, kinds = [], {}
        for (x, y), power, cube in zip(boxes.tiles.tolist(), powers, cubes):
            kind = power - THINNEST
            packed.append(frames[power].filled(self._id((x, y), kind), cube))
            kinds[x, y] = kinds.get((x, y), 0) | 1 << kind
        return packed, kinds

    def _cubes(self, boxes: BoxLists, blocks: Blocks) -> Iterator[bytes]:
        points, starts = boxes.centers.astype("<f8").tobytes(), boxes.starts.tolist()
        ends = list(zip(starts[:-1], starts[1:]))
        if self._color_by is ColorBy.TYPE:
            return (_list(points, _POINT_BYTES, *end) + _NO_COLORS for end in ends)
        colors = block_colors(blocks, self._color_by, self._limits)[boxes.owners]
        colors = np.column_stack([colors, np.ones(len(colors))]).astype("<f4").tobytes()
        return (_list(points, _POINT_BYTES, *end) + _list(colors, _COLOR_BYTES, *end) for end in ends)

    def _id(self, tile: Tile, kind: int) -> int:
        """Return a number of 31 bits that no other tile and class of boxes have."""
        return self._numbers.setdefault(tile, len(self._numbers)) * _POWERS + kind


class _Frame:
    """The bytes of an empty CUBE_LIST of one size, into which number and cubes are put."""

    def __init__(self, power: int, resolution: float, header: Header) -> None:
        marker = _marker(power, 0, header, Marker.ADD)
        marker.scale = Vector3(*box_size(resolution, power))
        data = _serialized(marker)
        number = _AFTER_STAMP_BYTES + len(header.frame_id.encode()) + 4 + len(marker.ns)
        # The message ends with five empty fields: points, colors, text, mesh and a flag.
        self._start, self._middle, self._end = data[:number], data[number + 4 : -_EMPTY_LISTS_BYTES], data[-9:]

    def filled(self, number: int, cubes: bytes) -> bytes:
        """Return the marker `number` with `cubes`, serialised points and colours."""
        return self._start + struct.pack("<i", number) + self._middle + cubes + self._end


def _array(packed: List[bytes]) -> PackedMarkerArray:
    return PackedMarkerArray(struct.pack("<I", len(packed)) + b"".join(packed))


def _list(elements: bytes, size: int, start: int, end: int) -> bytes:
    """Return elements from `start` to `end`, of `size` bytes each, as a list of a message."""
    return struct.pack("<I", end - start) + elements[size * start : size * end]


def _marker(power: int, number: int, header: Header, action: int) -> Marker:
    kind = box_type(power)
    marker = Marker(header=header, ns=kind.name.lower(), id=number, type=Marker.CUBE_LIST, action=action)
    marker.pose.orientation = Quaternion(w=1.0)
    marker.color = COLORS[kind]
    return marker


def _serialized(marker: Marker) -> bytes:
    buff = BytesIO()
    marker.serialize(buff)
    return buff.getvalue()
