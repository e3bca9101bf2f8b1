"""Definitions of message types, and messages of zeros to be filled in."""

from functools import lru_cache
from typing import Any, Callable

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from recordings.bags.messages import Messages

BEAM_TYPE = "underwater_map_construction/msg/SonarScanLine"

# msg/SonarScanLine.msg; an installation without ROS does not have that file.
_BEAM_DEFINITION = """\
Header header
float32 angle
uint8[] intensities
float32 maxrange_meters
float32 range_resolution
uint8 gain
float32 sensorAngle
"""
_OWN_TYPES = {
    BEAM_TYPE: _BEAM_DEFINITION,
    "avora_msgs/msg/SonarScanLine": _BEAM_DEFINITION,
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
}


@lru_cache(maxsize=None)
def defined_in(definition: str, name: str) -> Typestore:
    """Return a store with the type `name` and those it consists of, as a bag defines them."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, name))
    return store


@lru_cache(maxsize=None)
def ros1_types() -> Typestore:
    return _with_ours(Stores.ROS1_NOETIC)


@lru_cache(maxsize=None)
def ros2_types() -> Typestore:
    """Return the types of ROS 2 and ours, for bags of distributions before Iron, which hold no definitions."""
    return _with_ours(Stores.ROS2_HUMBLE)


def _with_ours(distribution: Stores) -> Typestore:
    store = get_typestore(distribution)
    for name, definition in _OWN_TYPES.items():
        if name not in store.types:
            store.register(get_types_from_msg(definition, name))
    return store


class StoreMessages(Messages):
    """Makes messages of the types of a store."""

    def __init__(self, store: Typestore) -> None:
        super().__init__(lambda kind: maker(store, kind.replace("/", "/msg/"))())

    def time(self, stamp_ns: int) -> Any:
        time = self.make("builtin_interfaces/Time")
        time.sec, time.nanosec = divmod(stamp_ns, 10**9)
        return time


@lru_cache(maxsize=None)
def maker(store: Typestore, name: str) -> Callable[[], Any]:
    """Return what makes new messages of a type, package/msg/Name; its definition is looked up once only.

    Raises KeyError for a type that the store does not know.
    """
    kind = store.types[name]
    makers = [_field_maker(store, field) for _, field in store.FIELDDEFS[name][1]]
    return lambda: kind(*[make() for make in makers])


def _field_maker(store: Typestore, kind: Any) -> Callable[[], Any]:
    node, detail = kind
    if node == Nodetype.BASE:
        name = detail[0]
        return str if name == "string" else bool if name == "bool" else float if name.startswith("float") else int
    if node == Nodetype.NAME:
        return maker(store, detail)
    (inner, inner_detail), length = detail
    count = length if node == Nodetype.ARRAY else 0
    if inner == Nodetype.BASE and inner_detail[0] != "string":
        dtype = "uint8" if inner_detail[0] in ("byte", "char", "octet") else inner_detail[0]
        return lambda: np.zeros(count, dtype=dtype)
    make = _field_maker(store, (inner, inner_detail))
    return lambda: [make() for _ in range(count)]
