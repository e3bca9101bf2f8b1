"""Messages whose fields are zero and empty, to be filled in as those of ROS are."""

from functools import lru_cache
from typing import Any, Callable

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore


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
