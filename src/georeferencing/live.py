"""Where the map lies, from fix to fix."""

from typing import List, Optional

import numpy as np

from georeferencing.adjustment import Adjusted, adjusted
from georeferencing.asked import AskedOrigin
from georeferencing.fixes import Fix, PlacedFixes
from georeferencing.origin import Origin

_MOST = 1200  # fixes: beyond it every second one is forgotten


class LiveOrigin:
    """Adjusts an origin to all fixes since a map began, each placed where the map had the vehicle then."""

    def __init__(self, asked: AskedOrigin, known: Optional[Origin] = None) -> None:
        """`known`: of a map that was loaded, which says more than `asked`."""
        self._asked, self._known = asked, known
        self._fixes: List[Fix] = []
        self._places: List[np.ndarray] = []

    def take(self, fix: Fix, place: np.ndarray, variance: float) -> Adjusted:
        """Return the origin, adjusted to one more fix at `place` (2,) [m] in map, whose coordinates have `variance`.

        Raises RefusedInput where the declination is asked for and not known.
        """
        self._fixes.append(fix)
        self._places.append(np.append(place, variance))
        if len(self._fixes) > _MOST:
            self._fixes, self._places = self._fixes[::2], self._places[::2]
        placed = np.array(self._places)
        fixes = PlacedFixes.of(self._fixes, placed[:, :2], placed[:, 2])
        return adjusted(fixes, self._known or self._asked.before(fixes))
