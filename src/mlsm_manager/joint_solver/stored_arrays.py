"""Dataclasses as named arrays, to be stored."""

from dataclasses import fields, is_dataclass
from typing import Any, Dict, List, Mapping, Sequence

import numpy as np

_LENGTHS = "#"  # after the name of arrays of different lengths, which stand one after the other


def stacked(items: Sequence[Any], prefix: str = "") -> Dict[str, np.ndarray]:
    """Return for each field its values in all items (n), (n, ...); the fields of a nested dataclass one by one."""
    arrays = {}
    for own in fields(items[0]) if items else ():
        values, name = [getattr(item, own.name) for item in items], prefix + own.name
        if is_dataclass(values[0]):
            arrays.update(stacked(values, f"{name}."))
        elif len({np.shape(value) for value in values}) == 1:
            arrays[name] = np.array(values)
        else:
            arrays[name] = np.concatenate(values)
            arrays[name + _LENGTHS] = np.array([len(value) for value in values])
    return arrays


def unstacked(kind: type, arrays: Mapping[str, np.ndarray], prefix: str = "") -> List[Any]:
    """Return the dataclasses of type `kind` that `stacked` took; none where `arrays` has no such field.

    Raises KeyError for a field that is missing, and ValueError for fields that are not equally long.
    """
    if not any(name.startswith(prefix) for name in arrays):
        return []
    columns = [_column(own.type, arrays, prefix + own.name) for own in fields(kind)]
    if len({len(column) for column in columns}) != 1:
        raise ValueError(f"{prefix}: {[len(column) for column in columns]} elements")
    return [kind(*values) for values in zip(*columns)]


def _column(kind: type, arrays: Mapping[str, np.ndarray], name: str) -> Sequence[Any]:
    if is_dataclass(kind):
        return unstacked(kind, arrays, f"{name}.")
    array, lengths = arrays[name], arrays.get(name + _LENGTHS)
    if lengths is None:
        return array.tolist() if array.ndim == 1 and kind is not np.ndarray else list(array)
    if lengths.sum() != len(array):
        raise ValueError(f"{name}: {len(array)} elements, must be {lengths.sum()}")
    return np.split(array, np.cumsum(lengths)[:-1])
