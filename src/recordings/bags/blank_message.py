"""Messages whose fields are zero and empty, to be filled in as those of ROS are."""

from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore


def blank_message(store: Typestore, name: str) -> Any:
    """Return a new message of a type, package/msg/Name. Raises KeyError for a type that the store does not know."""
    _, fields = store.FIELDDEFS[name]
    return store.types[name](**{field: _blank(store, kind) for field, kind in fields})


def _blank(store: Typestore, kind: Any) -> Any:
    node, detail = kind
    if node == Nodetype.BASE:
        name = detail[0]
        return "" if name == "string" else False if name == "bool" else 0.0 if name.startswith("float") else 0
    if node == Nodetype.NAME:
        return blank_message(store, detail)
    (inner, inner_detail), length = detail
    if inner == Nodetype.BASE and inner_detail[0] != "string":
        return np.zeros(length if node == Nodetype.ARRAY else 0, dtype=_dtype(inner_detail[0]))
    return [_blank(store, detail[0]) for _ in range(length if node == Nodetype.ARRAY else 0)]


def _dtype(name: str) -> np.dtype:
    return np.dtype("uint8" if name in ("byte", "char", "octet") else name)
