"""Latitude and longitude of points of the map (WGS 84, by way of earth-centred coordinates)."""

import math
import re
from dataclasses import dataclass

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import rotated

EAST_DEG = 90.0
_SEMI_MAJOR = 6378137.0  # m
_FLATTENING = 1.0 / 298.257223563
_ECCENTRICITY_SQUARED = _FLATTENING * (2.0 - _FLATTENING)
_ROUNDS = 5  # of the latitude's iteration: each brings it two digits nearer, at sea level more
_NUMBER = r"([-+]?\d+(?:\.\d*)?)"
_FORMAT = re.compile(rf"\s*{_NUMBER}\s*,\s*{_NUMBER}\s*(?:,\s*azimuth\s+{_NUMBER}\s*)?")


@dataclass(frozen=True)
class Origin:
    """Where the map's origin is, and where its x axis points: degrees clockwise from north, 90 for east (REP-103)."""

    latitude_deg: float
    longitude_deg: float
    azimuth_deg: float = EAST_DEG

    @classmethod
    def parsed(cls, text: str) -> "Origin":
        """Return the origin that "41.2, 3.1, azimuth 12" gives; the azimuth may be missing. Raises RefusedInput."""
        found = _FORMAT.fullmatch(text)
        if not found:
            raise RefusedInput("origins refused", f"{text!r}: must be as '41.2, 3.1' or '41.2, 3.1, azimuth 12'")
        numbers = [float(number) for number in found.groups() if number is not None]
        origin = cls(*numbers)
        if abs(origin.latitude_deg) > 89.0 or abs(origin.longitude_deg) > 180.0:
            raise RefusedInput("origins refused", f"{text!r}: latitude must be -89 to 89, longitude -180 to 180")
        return origin

    def degrees(self, points: np.ndarray) -> np.ndarray:
        """Return latitude and longitude (n, 2), deg, of points (n, >= 2) x y [m] of the map."""
        turn = math.radians(EAST_DEG - self.azimuth_deg)
        east, north = rotated(np.asarray(points, dtype=np.float64)[:, :2], np.array(turn)).T
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        sine, cosine = math.sin(latitude), math.cos(latitude)
        normal = _SEMI_MAJOR / math.sqrt(1.0 - _ECCENTRICITY_SQUARED * sine**2)
        # Earth-centred, turned so that x lies in the origin's meridian, y to its east.
        x = normal * cosine - sine * north
        z = normal * (1.0 - _ECCENTRICITY_SQUARED) * sine + cosine * north
        return np.degrees(np.column_stack([_latitude(np.hypot(x, east), z), longitude + np.arctan2(east, x)]))


def _latitude(distance: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the geodetic latitude (n,) rad of points at `distance` from the axis and z above the equator, m."""
    found = np.arctan2(z, distance * (1.0 - _ECCENTRICITY_SQUARED))
    for _ in range(_ROUNDS):
        sine = np.sin(found)
        normal = _SEMI_MAJOR / np.sqrt(1.0 - _ECCENTRICITY_SQUARED * sine**2)
        found = np.arctan2(z + _ECCENTRICITY_SQUARED * normal * sine, distance)
    return found
