"""Lists of equal dataclasses of numbers and arrays as one array for each field, and back."""

from dataclasses import fields, is_dataclass
from typing import Any, Dict, List, Mapping, Sequence

import numpy as np


def stacked(items: Sequence[Any], prefix: str = "") -> Dict[str, np.ndarray]:
    """Return for each field its values in all `items` (n), (n, ...); the fields of a nested dataclass one by one."""
    if not items:
        return {}
    arrays = {}
    for field in fields(items[0]):
        values = [getattr(item, field.name) for item in items]
        if is_dataclass(values[0]):
            arrays.update(stacked(values, f"{prefix}{field.name}."))
        else:
            arrays[prefix + field.name] = np.array(values)
    return arrays


def unstacked(kind: type, arrays: Mapping[str, np.ndarray], prefix: str = "") -> List[Any]:
    """Return the dataclasses of type `kind` that `stacked` took; none where `arrays` has no such field.

    Raises KeyError for a field that is missing, and ValueError for fields that are not equally long.
    """
    if not any(name.startswith(prefix) for name in arrays):
        return []
    columns = [_column(field.type, arrays, prefix + field.name) for field in fields(kind)]
    if len({len(column) for column in columns}) != 1:
        raise ValueError(f"{prefix}: {[len(column) for column in columns]} elements")
    return [kind(*values) for values in zip(*columns)]


def _column(kind: type, arrays: Mapping[str, np.ndarray], name: str) -> Sequence[Any]:
    if is_dataclass(kind):
        return unstacked(kind, arrays, f"{name}.")
    array = arrays[name]
    return array.tolist() if array.ndim == 1 and kind is not np.ndarray else list(array)
