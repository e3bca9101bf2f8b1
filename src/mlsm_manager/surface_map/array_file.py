"""Named arrays with some words about them in one block of bytes that cannot change unnoticed.

Layout: MAGIC, version (uint16), length of the header (uint32), header (JSON), the bytes of the arrays, and the SHA-256
of all before it. Arrays are little-endian, split into planes of their first, second, ... bytes: the planes of exponents
and of differences of indices repeat themselves and are packed by zlib, those of the last digits do not and are kept as
they are.
"""

import hashlib
import json
import math
import struct
import zlib
from typing import Any, Dict, List, Mapping, Tuple

import numpy as np

MAGIC = b"MLSM\r\n\x1a\n"  # As PNG's: a transfer that changes line ends breaks it
VERSION = 1
_FIXED = struct.Struct("<8sHI")
_DIGEST_BYTES = hashlib.sha256().digest_size
_TYPES = ("<f8", "<f4", "<i8", "<i4", "<u4", "<u2", "<u1")
_SAMPLE = 65536  # bytes of a plane that show whether packing the rest is worth its time
_WORTHWHILE = 0.95  # share of its sample that a packed plane has at most: above, the time to unpack costs more
_ZLIB_LEVEL = 1  # the fastest; the best one makes the files of maps 4 % smaller in ten times the time
_GREATEST_RATIO = 1032  # what zlib can pack at best: a plane that claims more was not made by it


class ArrayFileError(ValueError):
    """The bytes are not what `encoded` made; the text says in what."""


def encoded(words: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """Return the bytes of a file with `words` (what JSON can hold) and `arrays` of any shape."""
    entries: List[Dict[str, Any]] = []
    planes: List[bytes] = []
    for name, array in arrays.items():
        kind = array.dtype.newbyteorder("<").str.replace("|", "<")
        if kind not in _TYPES:
            raise TypeError(f"array {name}: type {array.dtype}, must be one of {', '.join(_TYPES)}")
        packed = _planes(array.astype(kind, copy=False))
        sizes = [len(plane) if is_packed else -len(plane) for plane, is_packed in packed]
        entries.append({"name": name, "type": kind, "shape": list(array.shape), "planes": sizes})
        planes += [plane for plane, _ in packed]
    header = json.dumps({"words": dict(words), "arrays": entries}, allow_nan=False).encode()
    content = b"".join([_FIXED.pack(MAGIC, VERSION, len(header)), header, *planes])
    return content + hashlib.sha256(content).digest()


def decoded(data: bytes) -> Tuple[Dict[str, Any], Dict[str, np.ndarray]]:
    """Return words and arrays of what `encoded` made. Raises ArrayFileError for any other bytes."""
    length, content = _checked(data)
    try:
        header, body = json.loads(bytes(content[:length]).decode()), content[length:]
        words, arrays = dict(header["words"]), {}
        for entry in header["arrays"]:
            arrays[entry["name"]], body = _array(entry, body)
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError, RecursionError, zlib.error) as error:
        raise ArrayFileError(f"its header does not fit its content ({error})") from None
    if len(body):
        raise ArrayFileError(f"{len(body)} bytes more than its header tells of")
    return words, arrays


def _checked(data: bytes) -> Tuple[int, memoryview]:
    """Return the length of the header, and header and arrays, with the checksum verified before they are read."""
    if data[: len(MAGIC)] != MAGIC:
        raise ArrayFileError("not a map of this package")
    if len(data) < _FIXED.size + _DIGEST_BYTES:
        raise ArrayFileError("cut short")
    _, version, length = _FIXED.unpack_from(data)
    if version != VERSION:
        raise ArrayFileError(f"version {version}, must be {VERSION}")
    content = memoryview(data)[:-_DIGEST_BYTES]
    if hashlib.sha256(content).digest() != data[-_DIGEST_BYTES:]:
        raise ArrayFileError("damaged or cut short: its checksum does not fit")
    return length, content[_FIXED.size :]


def _planes(array: np.ndarray) -> List[Tuple[bytes, bool]]:
    """Return for each byte of an element that byte of all elements, and whether it is packed."""
    if not array.size:
        return []
    columns = np.ascontiguousarray(array).view(np.uint8).reshape(array.size, array.dtype.itemsize)
    return [_packed(np.ascontiguousarray(columns[:, index])) for index in range(columns.shape[1])]


def _packed(plane: np.ndarray) -> Tuple[bytes, bool]:
    sample = plane[:_SAMPLE].tobytes()
    if len(zlib.compress(sample, _ZLIB_LEVEL)) >= _WORTHWHILE * len(sample):
        return plane.tobytes(), False
    return zlib.compress(plane.tobytes(), _ZLIB_LEVEL), True


def _array(entry: Mapping[str, Any], body: memoryview) -> Tuple[np.ndarray, memoryview]:
    kind, shape, sizes = entry["type"], tuple(int(length) for length in entry["shape"]), entry["planes"]
    if kind not in _TYPES or min(shape, default=0) < 0:
        raise ValueError(f"type {kind!r}, shape {shape}")
    count, width = math.prod(shape), np.dtype(kind).itemsize
    if len(sizes) != (width if count else 0) or count > _GREATEST_RATIO * max(len(body), 1):
        raise ValueError(f"{len(sizes)} planes of {count} elements of type {kind}")
    columns = np.empty((count, width), dtype=np.uint8)
    for index, size in enumerate(sizes):
        plane, body = body[: abs(size)], body[abs(size) :]
        columns[:, index] = np.frombuffer(_unpacked(plane, count) if size > 0 else plane, dtype=np.uint8)
    return columns.reshape(-1).view(kind).reshape(shape), body


def _unpacked(plane: memoryview, count: int) -> bytes:
    unpacking = zlib.decompressobj()
    # One byte more than there must be shows a plane that holds too much, without unpacking all of it.
    data = unpacking.decompress(plane, count + 1)
    if len(data) != count or unpacking.unconsumed_tail or not unpacking.eof:
        raise ValueError(f"a plane that is not {count} bytes long")
    return data
