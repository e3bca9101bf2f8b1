"""Many messages of one type to bytes at once: their fields hold one value for each of them, or one for all."""

from typing import Any, Iterator

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from recordings.bags.message_bytes import CODES, fields_of, text_bytes

_LENGTH = "<i4"


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
    for field, node, detail in fields_of(store, name):
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
        yield np.array([[length]], _LENGTH).view(np.uint8)
    if are_numbers and length:
        yield _numbers(values, detail[0], length)
    elif inner == Nodetype.NAME:
        for value in values:
            yield from _columns(store, detail, value)
    elif not are_numbers:
        for value in values:
            yield _text(value)


def _numbers(values: Any, kind: str, length: int) -> np.ndarray:
    numbers = np.asarray(values).astype("<" + CODES[kind]).reshape(-1, length)
    return np.ascontiguousarray(numbers).view(np.uint8)


def _text(text: str) -> np.ndarray:
    return np.frombuffer(text_bytes(text), np.uint8)[np.newaxis]
