"""Definitions of message types, messages of zeros to be filled in, and many messages to bytes at once."""

from functools import lru_cache
from typing import Any, Callable, Iterator

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

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


def defined_in(definition: str, name: str) -> Typestore:
    """Return a store with the type `name` and those it consists of, as a bag defines them."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, name))
    return store


@lru_cache(maxsize=None)
def ros1_types() -> Typestore:
    """Return the types of ROS 1 (Noetic) and ours."""
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


def blank_message(store: Typestore, name: str) -> Any:
    """Return a new message of a type, package/msg/Name. Raises KeyError for a type that the store does not know."""
    return _maker(store, name)()


@lru_cache(maxsize=None)
def _maker(store: Typestore, name: str) -> Callable[[], Any]:
    """Return what makes messages of a type; its definition is looked up once only."""
    kind = store.types[name]
    makers = [_field_maker(store, field) for _, field in store.FIELDDEFS[name][1]]
    return lambda: kind(*[make() for make in makers])


def _field_maker(store: Typestore, kind: Any) -> Callable[[], Any]:
    node, detail = kind
    if node == Nodetype.BASE:
        name = detail[0]
        return str if name == "string" else bool if name == "bool" else float if name.startswith("float") else int
    if node == Nodetype.NAME:
        return _maker(store, detail)
    (inner, inner_detail), length = detail
    count = length if node == Nodetype.ARRAY else 0
    if inner == Nodetype.BASE and inner_detail[0] != "string":
        dtype = _dtype(inner_detail[0])
        return lambda: np.zeros(count, dtype=dtype)
    make = _field_maker(store, (inner, inner_detail))
    return lambda: [make() for _ in range(count)]


def _dtype(name: str) -> np.dtype:
    return np.dtype("uint8" if name in ("byte", "char", "octet") else name)


def message_rows(store: Typestore, name: str, message: Any, number: int) -> np.ndarray:
    """Return (number, size) uint8, the bytes of each of `number` messages of a type, package/msg/Name.

    message: its numbers are arrays (number,), or one number; its arrays of numbers are (number, k), or (k,). Texts, and
    the lengths of lists, are the same for all; each message of a list is such a message too.
    """
    columns = list(_columns(store, name, message))
    rows = np.empty((number, sum(column.shape[1] for column in columns)), np.uint8)
    start = 0
    for column in columns:
        rows[:, start : start + column.shape[1]] = column
        start += column.shape[1]
    return rows


def _columns(store: Typestore, name: str, message: Any) -> Iterator[np.ndarray]:
    """Yield the bytes of each field, (number, k) or (1, k)."""
    for field, (node, detail) in store.FIELDDEFS[name][1]:
        if field == "structure_needs_at_least_one_member":  # of rosbags, where a message is empty
            continue
        value = getattr(message, field)
        if node == Nodetype.NAME:
            yield from _columns(store, detail, value)
        elif node == Nodetype.BASE:
            yield _text(value) if detail[0] == "string" else _numbers(value, detail[0], 1)
        else:
            yield from _list(store, value, detail[0], node == Nodetype.SEQUENCE)


def _list(store: Typestore, values: Any, kind: Any, has_length: bool) -> Iterator[np.ndarray]:
    inner, detail = kind
    are_numbers = inner == Nodetype.BASE and detail[0] != "string"
    length = np.shape(values)[-1] if are_numbers else len(values)
    if has_length:
        yield np.array([[length]], "<i4").view(np.uint8)
    if are_numbers and length:
        yield _numbers(values, detail[0], length)
    elif inner == Nodetype.NAME:
        for value in values:
            yield from _columns(store, detail, value)
    elif not are_numbers:
        for value in values:
            yield _text(value)


def _numbers(values: Any, kind: str, length: int) -> np.ndarray:
    numbers = np.asarray(values).astype(_dtype(kind).newbyteorder("<")).reshape(-1, length)
    return np.ascontiguousarray(numbers).view(np.uint8)


def _text(text: str) -> np.ndarray:
    encoded = text.encode()
    return np.frombuffer(len(encoded).to_bytes(4, "little") + encoded, np.uint8)[np.newaxis]
