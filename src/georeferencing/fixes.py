"""Positions by satellites: what a message tells, and all that were heard while the vehicle was at the surface."""

from dataclasses import dataclass
from typing import Any, List, NamedTuple, Sequence

import numpy as np

from node_support.errors import RefusedInput

UNKNOWN_DEVIATION = 3.0  # m, in each axis, of a receiver that does not tell its own
_LEAST_DEVIATION = 0.01  # m: a receiver that tells less has not measured it
_UNKNOWN, _ROS_POSITION = 0, slice(0, 2)  # NavSatFix.position_covariance_type; east and north of its covariance


class Fix(NamedTuple):
    """time: s. latitude_deg, longitude_deg: WGS 84. deviations: (2,) m, of east and north."""

    time: float
    latitude_deg: float
    longitude_deg: float
    deviations: Sequence[float] = (UNKNOWN_DEVIATION, UNKNOWN_DEVIATION)


def fix_of(message: Any) -> Fix:
    """Return what a NavSatFix of ROS 1 or ROS 2 tells; raises RefusedInput where its receiver had no fix."""
    stamp, place = message.header.stamp, (message.latitude, message.longitude)
    status = message.status.status
    seconds = getattr(stamp, "secs", None)
    time = stamp.sec + stamp.nanosec * 1e-9 if seconds is None else seconds + stamp.nsecs * 1e-9
    # Receivers without a fix send 0, 0 or no number too.
    if status < 0 or not np.isfinite(place).all() or not any(place):
        raise RefusedInput("satellite fixes without a position", f"status {status}, latitude, longitude {place}")
    variances = np.diag(np.reshape(message.position_covariance, (3, 3)))[_ROS_POSITION]
    known = message.position_covariance_type != _UNKNOWN and np.isfinite(variances).all() and (variances > 0.0).all()
    deviations = np.maximum(np.sqrt(variances), _LEAST_DEVIATION) if known else np.full(2, UNKNOWN_DEVIATION)
    return Fix(time, *place, tuple(deviations.tolist()))


@dataclass(frozen=True)
class PlacedFixes:
    """Fixes and where the map has the vehicle at their times.

    times: (n,) s. degrees: (n, 2) latitude and longitude. deviations: (n, 2) m, east and north. places: (n, 2) x y [m]
    in map. variances: (n,) m^2, of each coordinate of the places.
    """

    times: np.ndarray
    degrees: np.ndarray
    deviations: np.ndarray
    places: np.ndarray
    variances: np.ndarray

    @classmethod
    def of(cls, fixes: Sequence[Fix], places: np.ndarray, variances: np.ndarray) -> "PlacedFixes":
        """Return fixes (n) at their places (n, 2). One that repeats the place before it, to the digit, is left out:
        a receiver under water sends its last one on.
        """
        table = np.array([(*fix[:3], *fix.deviations) for fix in fixes]).reshape(-1, 5)
        fresh = np.append(True, (np.diff(table[:, 1:3], axis=0) != 0.0).any(axis=1))[: len(table)]
        kept = table[fresh]
        return cls(kept[:, 0], kept[:, 1:3], kept[:, 3:], np.asarray(places)[fresh], np.asarray(variances)[fresh])

    def __len__(self) -> int:
        return len(self.times)

    def take(self, chosen: np.ndarray) -> "PlacedFixes":
        """Return the fixes at `chosen`, a mask (n,) or indices (k,)."""
        columns: List[np.ndarray] = [self.times, self.degrees, self.deviations, self.places, self.variances]
        return PlacedFixes(*(column[chosen] for column in columns))
