"""Blocks as a MarkerArray whose points are written from numpy: the bytes of genpy, without its loop over objects."""

import struct
from io import BytesIO
from typing import Dict, Set, Tuple

import numpy as np
from geometry_msgs.msg import Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.surface_map.block_shapes import BoxList, box_lists
from mlsm_manager.surface_map.blocks import Blocks, BlockType

COLORS: Dict[BlockType, ColorRGBA] = {
    BlockType.HORIZONTAL: ColorRGBA(r=0.75, g=0.16, b=0.10, a=1.0),
    BlockType.VERTICAL: ColorRGBA(r=1.0, g=0.87, b=0.40, a=1.0),
}
# Four lengths of 4 bytes and the flag; behind the points follow the other three and the flag.
_EMPTY_LISTS_BYTES = 17
_AFTER_POINTS_BYTES = 13


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
    """Makes the MarkerArray of the whole map; remembers which markers rviz may hold, to delete those gone."""

    def __init__(self) -> None:
        self._shown: Set[Tuple[BlockType, int]] = set()

    def array(self, blocks: Blocks, header: Header) -> PackedMarkerArray:
        """Return the markers of all blocks, in namespaces "horizontal" and "vertical"."""
        lists = box_lists(blocks) if len(blocks) else []
        now = {(boxes.type, boxes.power) for boxes in lists}
        packed = [_packed_boxes(boxes, header) for boxes in lists]
        packed += [_serialized(_marker(kind, power, header, Marker.DELETE)) for kind, power in self._shown - now]
        self._shown = now
        return PackedMarkerArray(struct.pack("<I", len(packed)) + b"".join(packed))


def _marker(kind: BlockType, power: int, header: Header, action: int) -> Marker:
    marker = Marker(header=header, ns=kind.name.lower(), id=power + 64, type=Marker.CUBE_LIST, action=action)
    marker.pose.orientation = Quaternion(w=1.0)
    marker.color = COLORS[kind]
    return marker


def _packed_boxes(boxes: BoxList, header: Header) -> bytes:
    marker = _marker(boxes.type, boxes.power, header, Marker.ADD)
    marker.scale = Vector3(*boxes.size)
    frame = _serialized(marker)
    # The message ends with five empty fields: points, colors, text, mesh and a flag; the points go into the first.
    split = len(frame) - _EMPTY_LISTS_BYTES
    points = np.ascontiguousarray(boxes.centers, dtype="<f8").tobytes()
    return frame[:split] + struct.pack("<I", len(boxes.centers)) + points + frame[-_AFTER_POINTS_BYTES:]


def _serialized(marker: Marker) -> bytes:
    buff = BytesIO()
    marker.serialize(buff)
    return buff.getvalue()
