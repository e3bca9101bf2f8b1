"""What a user says of where the map lies, a place and an azimuth or that satellites tell it, and what these tell."""

import re
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import partial
from typing import List, Optional, Tuple

import numpy as np

from georeferencing.adjustment import COMPASS_DEVIATION, Adjusted, adjusted, of_compass
from georeferencing.fixes import Fix, PlacedFixes
from georeferencing.origin import EAST_DEG, Origin
from node_support.errors import RefusedInput, needed

_NUMBER = r"([-+]?\d+(?:\.\d*)?)"
_AZIMUTH = rf"(?:azimuth\s+(?:{_NUMBER}|(unknown))|(magnetic))"
_FORMAT = re.compile(rf"\s*(?:fixes|{_NUMBER}\s*,\s*{_NUMBER})\s*(?:,\s*{_AZIMUTH}\s*)?")
_HOW = (
    "must be as '41.2, 3.1', '41.2, 3.1, azimuth 12', '41.2, 3.1, magnetic', 'fixes', 'fixes, azimuth 12', "
    "'fixes, azimuth unknown' or 'fixes, magnetic'"
)


@dataclass(frozen=True)
class AskedOrigin:
    """place: latitude and longitude of the map's origin, deg; None: fixes tell it.

    azimuth_deg: of the x axis. is_magnetic: it counts from where the compass points. is_known: False where nothing but
    fixes tells it.
    """

    place: Optional[Tuple[float, float]]
    azimuth_deg: float = EAST_DEG
    is_magnetic: bool = False
    is_known: bool = True

    @classmethod
    def parsed(cls, text: str) -> "AskedOrigin":
        """Return what "41.2, 3.1, azimuth 12" or "fixes, magnetic" asks for. Raises RefusedInput."""
        found = _FORMAT.fullmatch(text)
        latitude, longitude, azimuth, unknown, magnetic = found.groups() if found else (None,) * 5
        place = None if latitude is None else (float(latitude), float(longitude))
        if not found or (place and unknown):
            raise RefusedInput("origins refused", f"{text!r}: {_HOW}")
        asked = cls(place, float(azimuth or EAST_DEG), bool(magnetic), not unknown)
        if place is not None:
            Origin(*place, asked.azimuth_deg)
        return asked

    def origin(self, time: float) -> Origin:
        """Return the origin at the place, on a day given by `time` [s since 1970]. Raises RefusedInput."""
        return Origin(*self.place, self._azimuth_deg(*self.place, time))

    def before(self, fixes: PlacedFixes) -> Origin:
        """Return what is known without fixes (n > 0) where they tell the place. Raises RefusedInput."""
        azimuth = self._azimuth_deg(*fixes.degrees[0], float(fixes.times[0]))
        return of_compass(fixes, azimuth, COMPASS_DEVIATION if self.is_known else np.inf)

    def _azimuth_deg(self, latitude: float, longitude: float, time: float) -> float:
        return self.azimuth_deg + (declination_deg(latitude, longitude, time) if self.is_magnetic else 0.0)


def declination_deg(latitude_deg: float, longitude_deg: float, seconds: float) -> float:
    """Return how far magnetic north lies east of north at sea level, deg; `seconds`: since 1970.

    By the World Magnetic Model, with the coefficients that pygeomag carries (2010 to 2030).

    Raises RefusedInput for a time without coefficients, near a magnetic pole, and without pygeomag.
    """
    pygeomag = needed("pygeomag", "pip install pygeomag", partial(RefusedInput, "origins refused"))
    date = datetime.fromtimestamp(seconds, timezone.utc)
    year = date.year + (date.timetuple().tm_yday - 1) / 365.25
    try:
        model = pygeomag.GeoMag(base_year=date)
        field = model.calculate(latitude_deg, longitude_deg, 0.0, year, raise_in_warning_zone=True)
    except Exception as error:  # pygeomag has no common class for a wrong year and a compass that points down
        raise RefusedInput("origins refused", f"no declination in {date.year}: {error}") from error
    return float(field.d)


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
