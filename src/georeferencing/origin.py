"""Where the map lies on the Earth, and latitude and longitude of its points (WGS 84)."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from node_support.errors import RefusedInput, needed
from node_support.geometry import rotated

EAST_DEG = 90.0
STORED = "origin"  # array in which map files keep an origin


@dataclass(frozen=True)
class Origin:
    """Where the map's origin is, and where its x axis points: degrees clockwise from north, 90 for east (REP-103).

    covariance: (3, 3) of what is told: east and north of the origin [m], yaw of the x axis from east [rad].
    """

    latitude_deg: float
    longitude_deg: float
    azimuth_deg: float = EAST_DEG
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)), compare=False)

    def __post_init__(self) -> None:
        """Raise RefusedInput for a place that no chart shows."""
        numbers = self.latitude_deg, self.longitude_deg, self.azimuth_deg
        if not (np.isfinite(numbers).all() and abs(self.latitude_deg) <= 89.0 and abs(self.longitude_deg) <= 180.0):
            must = "latitude must be -89 to 89, longitude -180 to 180"
            raise RefusedInput("origins refused", f"{self.latitude_deg:g}, {self.longitude_deg:g}: {must}")

    @classmethod
    def of_array(cls, stored: np.ndarray) -> "Origin":
        """Return the origin that `array` gave. Raises RefusedInput for any other array."""
        if np.shape(stored) != (12,) or not np.isfinite(stored).all():
            raise RefusedInput("origins refused", f"{stored!r} was stored or sent as one")
        return cls(*(float(number) for number in stored[:3]), np.reshape(stored[3:], (3, 3)))

    @property
    def array(self) -> np.ndarray:
        """(12,), as a map file keeps it."""
        numbers = self.latitude_deg, self.longitude_deg, self.azimuth_deg
        return np.concatenate([numbers, self.covariance.ravel()])

    @property
    def yaw(self) -> float:
        """Heading of the x axis, counter-clockwise from east, rad."""
        return float(np.radians(EAST_DEG - self.azimuth_deg))

    @property
    def plane(self) -> str:
        """The PROJ string of metres east and north of the origin: distances and directions from it are exact."""
        return f"+proj=aeqd +lat_0={self.latitude_deg!r} +lon_0={self.longitude_deg!r} +datum=WGS84 +units=m"

    @property
    def utm(self) -> str:
        """The EPSG code of the zone of UTM in which the origin lies, such as EPSG:32631."""
        zone = int((self.longitude_deg + 180.0) // 6.0) % 60 + 1
        return f"EPSG:{(32700 if self.latitude_deg < 0.0 else 32600) + zone}"

    def degrees(self, points: np.ndarray) -> np.ndarray:
        """Return latitude and longitude (n, 2), deg, of points (n, >= 2) x y [m] of the map."""
        east, north = self._east_north(points).T
        longitude, latitude = _projection(self.plane)(east, north, inverse=True)
        return np.column_stack([latitude, longitude])

    def points(self, degrees: np.ndarray) -> np.ndarray:
        """Return the points (n, 2) x y [m] of the map at latitudes and longitudes (n, 2), deg."""
        latitude, longitude = np.asarray(degrees, dtype=np.float64).T
        east_north = np.column_stack(_projection(self.plane)(longitude, latitude))
        return rotated(east_north, np.array(-self.yaw))

    def jacobian(self, points: np.ndarray) -> np.ndarray:
        """Return how the places of points (n, >= 2) of the map move, east and north, with the origin: (n, 2, 3)."""
        return moved_with_origin(self._east_north(points))

    def _east_north(self, points: np.ndarray) -> np.ndarray:
        return rotated(np.asarray(points, dtype=np.float64)[:, :2], np.array(self.yaw))

    def __str__(self) -> str:
        deviation = np.sqrt(np.trace(self.covariance[:2, :2]))
        text = f"{self.latitude_deg:.7f}, {self.longitude_deg:.7f}, azimuth {self.azimuth_deg:.2f}"
        turn = np.degrees(np.sqrt(self.covariance[2, 2]))
        return f"{text} (deviations {deviation:.2f} m and {turn:.2f} degrees)" if self.covariance.any() else text


def moved_with_origin(places: np.ndarray) -> np.ndarray:
    """Return how places (..., 2) m, east and north of the origin, move with it and turn with the map: (..., 2, 3)."""
    jacobian = np.zeros((*places.shape, 3))
    jacobian[..., 0, 0] = jacobian[..., 1, 1] = 1.0
    jacobian[..., 0, 2], jacobian[..., 1, 2] = -places[..., 1], places[..., 0]
    return jacobian


def _projection(text: str) -> Any:
    # A mapping node without an origin shall not wait for PROJ.
    return needed("pyproj", "apt install python3-pyproj", partial(RefusedInput, "origins refused")).Proj(text)
