"""Small damages to the bytes of a file, and to the words and numbers of a text."""

import re
from functools import partial

import numpy as np

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_WORD = re.compile(rb"[\w.]+")
_ODD = (
    b"0", b"-1", b"1e308", b"-1e30", b"1e15", b"99999999999999999999", b"1e-300", b"nan", b".inf", b"", b"abc", b"[]",
    b"{}", b"null", b"true", b"1e9", b"'", b"\xff", b"2000-01-01", b"[1, [2]]", b"&a [*a]",
)  # fmt: skip
_DEEP = 3000  # brackets


def mutated(data: bytes, is_text: bool, rng: np.random.Generator) -> bytes:
    """Return `data` with one to three damages."""
    damages = _TEXT_DAMAGES + _DAMAGES if is_text else _DAMAGES
    for _ in range(rng.integers(1, 4)):
        data = damages[rng.integers(len(damages))](data, rng)
    return data


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _without_part(data: bytes, rng: np.random.Generator) -> bytes:
    start = rng.integers(len(data) + 1)
    return data[:start] + data[start + rng.integers(1, 65) :]


def _part_twice(data: bytes, rng: np.random.Generator) -> bytes:
    start = rng.integers(len(data) + 1)
    return data[: start + rng.integers(1, 65)] + data[start:]


def _other_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for place in rng.integers(max(len(data), 1), size=rng.integers(1, 9)) if data else ():
        changed[place] = rng.choice([0, 255, rng.integers(256)])
    return bytes(changed)


def _great_number(data: bytes, rng: np.random.Generator) -> bytes:
    """Write a length or a double that nobody expects over four or eight bytes."""
    start = rng.integers(len(data) + 1)
    value = (b"\xff\xff\xff\x7f", b"\xff" * 8, bytes(8), b"\0\0\0\0\0\0\xf0\x7f")[rng.integers(4)]
    return data[:start] + value + data[start + len(value) :]


def _replaced(pattern: "re.Pattern[bytes]", data: bytes, rng: np.random.Generator) -> bytes:
    found = list(pattern.finditer(data))
    if not found:
        return data
    one = found[rng.integers(len(found))]
    return data[: one.start()] + _ODD[rng.integers(len(_ODD))] + data[one.end() :]


def _without_line(data: bytes, rng: np.random.Generator) -> bytes:
    lines = data.splitlines(keepends=True)
    if lines:
        del lines[rng.integers(len(lines))]
    return b"".join(lines)


def _deep(data: bytes, rng: np.random.Generator) -> bytes:
    start = rng.integers(len(data) + 1)
    return data[:start] + (b"[", b"{a: ", b"<a>")[rng.integers(3)] * _DEEP + data[start:]


_DAMAGES = (_cut, _without_part, _part_twice, *3 * (_other_bytes, _great_number))
_OTHER_WORDS = (partial(_replaced, _NUMBER), partial(_replaced, _WORD))
_TEXT_DAMAGES = (*10 * _OTHER_WORDS, _without_line, _deep)
