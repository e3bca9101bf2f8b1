"""A raster of free water around a path: a basin, a canal and wider water, with objects in it."""

from dataclasses import dataclass
from typing import Tuple

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from benchmarks.twins.parameters import TwinParameters

RESOLUTION = 0.2  # m: a tenth of the accuracy that is looked for
_MARGIN = 80.0  # m around the path, more than the sonar's range
_CLEARANCE = 5.0  # m around the path in which nothing stands
_SHIP = (12.0, 3.5)  # m, length and beam
_CANAL_SMOOTHING = 600  # samples of the path, 60 s: banks do not follow a vehicle's weaving


@dataclass(frozen=True)
class Water:
    """free: (rows, columns) bool, true where there is water. origin: (2,) m of its first cell. slopes: (2, ...)."""

    free: np.ndarray
    origin: np.ndarray
    slopes: np.ndarray

    def cells(self, places: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return rows and columns of places (..., 2); those outside count as on the edge."""
        index = ((places - self.origin) / RESOLUTION).astype(np.int32)
        index = np.clip(index, 0, np.array(self.free.shape) - 1)
        return index[..., 0], index[..., 1]


def made_water(path: np.ndarray, parameters: TwinParameters, rng: np.random.RandomState) -> Water:
    """Return the water around a path (m, 2)."""
    origin = path.min(axis=0) - _MARGIN
    free = np.zeros(((path.max(axis=0) + _MARGIN - origin) / RESOLUTION).astype(int), dtype=bool)
    smooth = _smoothed(path)
    for row in range(0, len(path), 20):
        centre, radius = _channel(row / len(path), path[row], smooth[row], parameters)
        _fill_disc(free, origin, centre, radius)
    kept = np.zeros_like(free)
    for place in path[::50]:
        _fill_disc(kept, origin, place, _CLEARANCE)
    for _ in range(parameters.objects):
        _add_object(free, kept, origin, path[rng.randint(len(path))] + rng.normal(0.0, 16.0, 2), rng)
    return water_of(free, origin)


def water_of(free: np.ndarray, origin: np.ndarray) -> Water:
    """Return the water of a raster (rows, columns) bool whose first cell is at `origin` (2,) [m]."""
    blurred = gaussian_filter(free.astype(np.float32), 4.0)
    return Water(free, origin, np.stack(np.gradient(blurred)))


def ebbed(water: Water, fall: float) -> Water:
    """Return the water when banks and objects have grown into it by `fall` [m]."""
    if fall <= 0.0:
        return water
    return Water(distance_transform_edt(water.free) * RESOLUTION > fall, water.origin, water.slopes)


def with_ship(water: Water, place: np.ndarray, heading: float) -> Water:
    """Return the water with a ship's hull in it, at `place` (2,) [m]."""
    free = water.free.copy()
    _add_hull(free, np.zeros_like(free), water.origin, place, heading, *_SHIP)
    low, high = (np.maximum(((place + side * _SHIP[0] - water.origin) / RESOLUTION).astype(int), 0) for side in (-1, 1))
    part = (slice(low[0], high[0]), slice(low[1], high[1]))
    slopes = water.slopes.copy()
    if min(free[part].shape) > 1:
        slopes[(slice(None), *part)] = water_of(free[part], water.origin).slopes
    return Water(free, water.origin, slopes)


def _smoothed(path: np.ndarray) -> np.ndarray:
    window = min(_CANAL_SMOOTHING, len(path) // 4) * 2 + 1
    padded = np.pad(path, ((window // 2, window // 2), (0, 0)), mode="edge")
    total = np.cumsum(np.vstack([np.zeros((1, 2)), padded]), axis=0)
    return (total[window:] - total[:-window]) / window


def _channel(
    share: float, place: np.ndarray, smooth: np.ndarray, parameters: TwinParameters
) -> Tuple[np.ndarray, float]:
    if share < 0.62:
        centre, radius = place, parameters.basin_radius if share < 0.43 else 0.8 * parameters.basin_radius
    elif share < 0.83:
        return smooth, parameters.canal_radius
    else:
        centre, radius = place, 1.2 * parameters.basin_radius
    return centre, radius + 1.5 * np.sin(centre[0] / 7.0 + centre[1] / 11.0)


def _fill_disc(raster: np.ndarray, origin: np.ndarray, centre: np.ndarray, radius: float) -> None:
    low = np.maximum(((centre - radius - origin) / RESOLUTION).astype(int), 0)
    high = ((centre + radius - origin) / RESOLUTION).astype(int) + 1
    x, y = (np.arange(low[axis], high[axis]) * RESOLUTION + origin[axis] - centre[axis] for axis in (0, 1))
    part = raster[low[0] : high[0], low[1] : high[1]]
    part |= (x[: part.shape[0], np.newaxis] ** 2 + y[np.newaxis, : part.shape[1]] ** 2) < radius**2


def _add_object(
    free: np.ndarray, kept: np.ndarray, origin: np.ndarray, place: np.ndarray, rng: np.random.RandomState
) -> None:
    angle = rng.choice([0.2, 1.77]) + rng.normal(0.0, 0.1)
    length, width = (rng.uniform(4.0, 14.0), rng.uniform(0.5, 2.0)) if rng.rand() < 0.7 else (0.8, 0.8)
    _add_hull(free, kept, origin, place, angle, length, width)


def _add_hull(
    free: np.ndarray, kept: np.ndarray, origin: np.ndarray, place: np.ndarray, angle: float, length: float, width: float
) -> None:
    """Fill a rectangle that stands at `angle` [rad], but for what is `kept` free."""
    low = np.maximum(((place - length - origin) / RESOLUTION).astype(int), 0)
    high = np.maximum(((place + length - origin) / RESOLUTION).astype(int), 0)
    part, held = (raster[low[0] : high[0], low[1] : high[1]] for raster in (free, kept))
    x = (np.arange(part.shape[0]) + low[0]) * RESOLUTION + origin[0] - place[0]
    y = (np.arange(part.shape[1]) + low[1]) * RESOLUTION + origin[1] - place[1]
    along = x[:, np.newaxis] * np.cos(angle) + y * np.sin(angle)
    across = -x[:, np.newaxis] * np.sin(angle) + y * np.cos(angle)
    part &= ~((np.abs(along) < length / 2.0) & (np.abs(across) < width / 2.0) & ~held)
