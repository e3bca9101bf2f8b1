"""The bytes that a page gets and the texts that it may send; web/connection.js reads and writes the same.

A binary message begins with 8 bytes: its kind, a number of 8 bits, one of 16 bits, and 4 bytes that depend on the kind.
All numbers are little-endian; lists of wide numbers come first, so that each begins where its type may begin.
"""

import json
import math
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Union

import numpy as np

from node_support.errors import RefusedInput
from node_support.marks import Mark

LONGEST_REQUEST = 1024  # bytes
_TURN = 65536  # steps of an angle of 16 bits
_KIND = "requests refused"


class Kind(IntEnum):
    """Of a binary message."""

    TILE = 1
    BEAM = 2
    TRACK = 3
    FIXES = 4


@dataclass(frozen=True)
class Hello:
    """A page begins: what it has of which run, as it was told in `now`; nothing the first time."""

    run: str
    revision: int


@dataclass(frozen=True)
class DeleteMark:
    """Somebody deletes a mark."""

    name: str


MarkRequest = Union[Mark, DeleteMark]  # a Mark: somebody marks a place
Request = Union[Hello, MarkRequest]


def parsed(text: Union[str, bytes]) -> Request:
    """Return what a page asks for; raises RefusedInput for anything else, whoever sent it."""
    if not isinstance(text, str) or len(text) > LONGEST_REQUEST:
        raise RefusedInput(_KIND, f"{len(text)} bytes, must be a text of at most {LONGEST_REQUEST}")
    try:
        asked = json.loads(text)
        (verb,) = asked
        given = asked[verb]
        if verb == "hello":
            return Hello(_of_type(str, given["run"]), _of_type(int, given["revision"]))
        if verb == "mark":
            return Mark(given["name"], given["x"], given["y"])
        if verb == "delete":
            return DeleteMark(_of_type(str, given["name"]))
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        if isinstance(error, RefusedInput):
            raise
        raise RefusedInput(_KIND, f"{text[:80]!r}: {type(error).__name__}") from None
    raise RefusedInput(_KIND, f"{verb[:80]!r}, must be hello, mark or delete")


def _of_type(kind: type, value: Any) -> Any:
    if not isinstance(value, kind):
        raise TypeError(f"must be of type {kind.__name__}")
    return value


def text_of(**words: Any) -> str:
    """Return words as JSON; what is not finite becomes null, which JSON knows."""
    return json.dumps(_finite(words), separators=(",", ":"), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, (list, tuple)) else value


def tile_bytes(x: int, y: int, columns: np.ndarray) -> bytes:
    """Return a tile; columns: (4, n) index of each cell, when it was first seen, strength, place within it."""
    head = struct.pack("<BBHhh", Kind.TILE, 0, columns.shape[1], x, y)
    return head + b"".join(part.astype(kind).tobytes() for part, kind in zip(columns, ("<u2", "<u2", "u1", "u1")))


def beam_bytes(
    reach: float, width: float, from_bow: float, in_map: float, place: np.ndarray, strengths: np.ndarray
) -> bytes:
    """Return a beam `width` [rad] wide that hears `reach` [m] far, with strengths (bins,) uint8, at most 255 bins.

    from_bow, in_map: its directions from the bow and from the map's x axis, rad, counter-clockwise. place: (2,) m, from
    where in the map.
    """
    head = struct.pack("<BBHf", Kind.BEAM, len(strengths), _steps(width), reach)
    return head + struct.pack("<HHff", _steps(from_bow), _steps(in_map), *place) + strengths.tobytes()


def _steps(angle: float) -> int:
    return round(angle / (2.0 * math.pi) * _TURN) % _TURN


def rows_bytes(kind: Kind, chunk: int, rows: np.ndarray) -> bytes:
    """Return rows (n, columns) of a track or of fixes as float32; chunk: which part of all rows they are."""
    return struct.pack("<BBHI", kind, rows.shape[1], len(rows), chunk) + rows.astype("<f4").tobytes()
