"""Places in the map that somebody gave a name, as "mooring block"."""

import math
from dataclasses import dataclass
from typing import Dict, Iterable, List

from node_support.errors import RefusedInput

MOST_MARKS = 500
LONGEST_NAME = 60  # letters
_FARTHEST = 1e6  # m from the map's origin
_KIND = "marks refused"


@dataclass(frozen=True)
class Mark:
    """A name and its place x, y, z [m] in the map. Raises RefusedInput for what is neither shown nor kept."""

    name: str
    x: float
    y: float
    z: float = 0.0

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and 0 < len(self.name) <= LONGEST_NAME and self.name.isprintable()):
            shown = f"name {str(self.name)[:LONGEST_NAME]!r}"
            raise RefusedInput(_KIND, f"{shown}, must be 1 to {LONGEST_NAME} printable letters")
        for value in (self.x, self.y, self.z):
            is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not (is_number and math.isfinite(value) and abs(value) <= _FARTHEST):
                raise RefusedInput(_KIND, f"{self.name!r} at {value!r} m, must be a number within {_FARTHEST:g} m")


class Marks:
    """The marks of one map; a name stands for one place."""

    def __init__(self, marks: Iterable[Mark] = ()) -> None:
        self._marks: Dict[str, Mark] = {mark.name: mark for mark in marks}

    def set(self, mark: Mark) -> None:
        """Add a mark, or move the one of its name; raises RefusedInput where there are too many."""
        if mark.name not in self._marks and len(self._marks) >= MOST_MARKS:
            raise RefusedInput(_KIND, f"{mark.name!r} after {MOST_MARKS} others; delete some")
        self._marks[mark.name] = mark

    def delete(self, name: str) -> None:
        """Forget the mark of a name; raises RefusedInput where there is none."""
        if self._marks.pop(name, None) is None:
            raise RefusedInput(_KIND, f"{name[:LONGEST_NAME]!r} is no mark's name")

    def all(self) -> List[Mark]:
        return list(self._marks.values())
