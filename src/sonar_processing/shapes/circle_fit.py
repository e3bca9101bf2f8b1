"""Where a round thing stands that a few wide beams have seen from one side."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

_RAYS = 9
_RANGE_SD = 0.1
_BEARING_SD = 0.15


@dataclass(frozen=True)
class CircleSight:
    """Echoes of one thing: points (n, 2) and the sonar's places (n, 2), x y [m]; weights (n,) > 0; beam_width [rad]."""

    points: np.ndarray
    origins: np.ndarray
    weights: np.ndarray
    beam_width: float


@dataclass(frozen=True)
class CircleFit:
    """center (2,) and radius [m]; residual: root mean square range difference, m."""

    center: np.ndarray
    radius: float
    residual: float


def fitted_circle(sight: CircleSight, min_radius: float, max_radius: float) -> CircleFit:
    """Return the circle that explains ranges and bearings best.

    A buoy at 10 m is as wide as two or three beams. Each beam that grazes it is drawn on its own axis, beside the
    buoy, so that points do not lie on the circle; what a beam measures is the mean range of the part of the circle
    that it covers. That is compared, and the bearing: the mean of the beams' bearings, weighted by their echoes.
    What the echoes leave open (the radius, for far things) stays near the middle of the allowed radii.
    """
    middle, half = (min_radius + max_radius) / 2.0, max((max_radius - min_radius) / 2.0, 1e-6)
    origin = sight.weights @ sight.origins / sight.weights.sum()
    seen = sight.weights @ sight.points / sight.weights.sum()
    outward = (seen - origin) / max(np.linalg.norm(seen - origin), 1e-9)
    sideways = np.array([-outward[1], outward[0]])

    def residuals(unknown: np.ndarray) -> np.ndarray:
        center = seen + unknown[0] * outward + unknown[1] * sideways
        ranges = range_differences(sight, center, unknown[2])
        return np.concatenate([ranges / _RANGE_SD, [unknown[1] / _BEARING_SD, (unknown[2] - middle) / half]])

    low, high = [-max_radius, -max_radius, middle - half], [3.0 * max_radius, max_radius, middle + half]
    solution = least_squares(residuals, [0.8 * middle, 0.0, middle], bounds=(low, high)).x
    center = seen + solution[0] * outward + solution[1] * sideways
    differences = range_differences(sight, center, solution[2])
    return CircleFit(center, float(solution[2]), float(np.sqrt(np.mean(differences**2))))


def range_differences(sight: CircleSight, center: np.ndarray, radius: float) -> np.ndarray:
    """Return (n,) measured range minus the mean range of the part of the circle that the beam covers, m.

    A ray that passes the circle counts as if it met it where they are nearest.
    """
    measured = sight.points - sight.origins
    to_center = center - sight.origins
    ranges = np.hypot(measured[:, 0], measured[:, 1])
    bearings = np.arctan2(measured[:, 1], measured[:, 0]) - np.arctan2(to_center[:, 1], to_center[:, 0])
    rays = bearings[:, np.newaxis] + np.linspace(-0.5, 0.5, _RAYS) * sight.beam_width
    distance = np.hypot(to_center[:, 0], to_center[:, 1])[:, np.newaxis]
    beside = distance * np.sin(rays)
    hits = np.abs(beside) < radius
    hits |= np.abs(beside) <= np.abs(beside).min(axis=1, keepdims=True)
    near_side = distance * np.cos(rays) - np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
    return ranges - (near_side * hits).sum(axis=1) / hits.sum(axis=1)
