"""Twins of a recorded run: its path and timing, in other water and with other errors.

The water is a raster around the path; a scanning sonar with a beam of some width hears it.
"""

from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np
from scipy.ndimage import gaussian_filter

from benchmarks.harness import placed
from benchmarks.twin_conditions import TwinParameters, reported, true_path
from mlsm_manager.offline.recording import Recording, Truth
from node_support.geometry import matrices, rotated

RESOLUTION = 0.2  # m: a tenth of the accuracy that is looked for
_MARGIN = 80.0  # m around the path, more than the sonar's range
_CLEARANCE = 5.0  # m around the path in which nothing stands
_CANAL_SMOOTHING = 600  # samples of the path, 60 s: banks do not follow a vehicle's weaving
_AT_ENDS = 2.0  # s at both ends of the recording without beams, so that odometry covers delayed beams


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
    """Fill a rectangle, a pier, a boat or a post, but for what is `kept` free."""
    angle = rng.choice([0.2, 1.77]) + rng.normal(0.0, 0.1)
    length, width = (rng.uniform(4.0, 14.0), rng.uniform(0.5, 2.0)) if rng.rand() < 0.7 else (0.8, 0.8)
    low = np.maximum(((place - length - origin) / RESOLUTION).astype(int), 0)
    high = np.maximum(((place + length - origin) / RESOLUTION).astype(int), 0)
    part, held = (raster[low[0] : high[0], low[1] : high[1]] for raster in (free, kept))
    x = (np.arange(part.shape[0]) + low[0]) * RESOLUTION + origin[0] - place[0]
    y = (np.arange(part.shape[1]) + low[1]) * RESOLUTION + origin[1] - place[1]
    along = x[:, np.newaxis] * np.cos(angle) + y * np.sin(angle)
    across = -x[:, np.newaxis] * np.sin(angle) + y * np.cos(angle)
    part &= ~((np.abs(along) < length / 2.0) & (np.abs(across) < width / 2.0) & ~held)


BINS, BIN = 500, 0.1  # of the recorded head: 50 m
_OFFSETS = np.radians([-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0])  # rays across the beam
_NEAREST = 5  # bins that ring
_THRESHOLD = 12.0  # dB
_CHUNK = 2000  # beams at once, bounds the memory
_BINARY = 127
_LEVEL_PER_DB = 4.0  # strength steps per dB of graded echoes
_NOISE = 6.0  # strength of graded noise


def heard(
    water: Water, poses: np.ndarray, bearings: np.ndarray, sonar_in_base: np.ndarray, parameters: TwinParameters,
    rng: np.random.RandomState,
) -> np.ndarray:  # fmt: skip
    """Return strengths (n, bins) uint8 of beams sent at T_map_base (n, 3) towards bearings (n,) [rad] in base_link."""
    sonar = poses[:, :2] + rotated(np.broadcast_to(sonar_in_base, (len(poses), 2)), poses[:, 2])
    image = np.zeros((len(poses), BINS), dtype=np.float32)
    for offset in _OFFSETS:
        angle = bearings + poses[:, 2] + offset
        ranges, hit = _nearest(water, sonar, angle)
        level = parameters.strength + _loss(water, sonar, angle, ranges, offset, parameters.half_width)
        level = level + rng.normal(0.0, 3.0, len(ranges))
        _add_echoes(image, ranges, level, hit & (level > _THRESHOLD), parameters, rng)
    _add_clutter(image, parameters.clutter, rng)
    if not parameters.binary:
        image += np.abs(rng.normal(0.0, _NOISE, image.shape))
    if parameters.range_scale:
        true_bins = (np.arange(BINS) + 0.5) * (1.0 + parameters.range_scale)
        image = image[:, np.clip(true_bins, 0, BINS - 1).astype(int)]
    return np.clip(image, 0, 255).astype(np.uint8)


def _nearest(water: Water, sonar: np.ndarray, angle: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return ranges (n,) of the nearest surface along each ray, and whether there is one."""
    distance = np.arange(_NEAREST, BINS) * BIN
    hit = np.zeros(len(angle), dtype=bool)
    ranges = np.full(len(angle), distance[-1])
    for start in range(0, len(angle), _CHUNK):
        part = slice(start, start + _CHUNK)
        ray = np.stack([np.cos(angle[part]), np.sin(angle[part])], axis=1).astype(np.float32)
        places = sonar[part, np.newaxis] + distance[np.newaxis, :, np.newaxis] * ray[:, np.newaxis]
        blocked = ~water.free[water.cells(places)]
        hit[part] = blocked.any(axis=1)
        ranges[part] = np.where(hit[part], distance[blocked.argmax(axis=1)], distance[-1])
    return ranges, hit


def _loss(
    water: Water, sonar: np.ndarray, angle: np.ndarray, ranges: np.ndarray, offset: float, half_width: float
) -> np.ndarray:
    """Return by how many dB an echo differs from one at 10 m, square-on and on the axis."""
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    slope = water.slopes[(slice(None), *water.cells(sonar + ranges[:, np.newaxis] * ray))]
    cosine = np.abs((slope.T * ray).sum(axis=1)) / (np.hypot(*slope) + 1e-9)
    spreading = -25.0 * np.log10(np.maximum(ranges, 1.0) / 10.0)
    return spreading + 18.0 * np.log10(np.maximum(cosine, 0.05)) - 2.2 * (offset / half_width) ** 2


def _add_echoes(
    image: np.ndarray, ranges: np.ndarray, level: np.ndarray, seen: np.ndarray, parameters: TwinParameters,
    rng: np.random.RandomState,
) -> None:  # fmt: skip
    length = parameters.echo_length * (level - _THRESHOLD + 2.0) / 10.0 + rng.exponential(0.6, len(ranges))
    last = np.minimum((ranges + np.clip(length, 0.5, 6.0)) / BIN, BINS).astype(int)
    first = np.clip((ranges + rng.normal(0.0, 0.1, len(ranges))) / BIN, 0, BINS - 1).astype(int)
    strength = np.full(len(ranges), _BINARY) if parameters.binary else 20.0 + _LEVEL_PER_DB * (level - _THRESHOLD)
    for beam in np.flatnonzero(seen):
        echo = image[beam, first[beam] : last[beam]]
        np.maximum(echo, strength[beam], out=echo)


def _add_clutter(image: np.ndarray, share: float, rng: np.random.RandomState) -> None:
    for beam in np.flatnonzero(rng.rand(len(image)) < share):
        start = rng.randint(20, BINS - 20)
        image[beam, start : start + rng.randint(5, 30)] = _BINARY


def twin_of(source: Recording, parameters: TwinParameters) -> Recording:
    """Return a recording with the path and timing of `source` and conditions of its own; the truth is known."""
    rng = np.random.RandomState(parameters.seed)
    path = true_path(source.track, parameters)
    water = made_water(path.poses[:, :2], parameters, rng)
    odometry = reported(path, parameters, rng)
    stamps = source.times
    inside = (stamps > path.times[0] + _AT_ENDS) & (stamps < path.times[-1] - _AT_ENDS)
    beams = [placed.beam for placed, kept in zip(source.beams, inside) if kept]
    stamps = stamps[inside]
    T_base_sonar = (
        np.linalg.inv(matrices(source.track.at(stamps[:1]))[0])
        @ source.beams[int(np.flatnonzero(inside)[0])].T_target_sonar
    )
    mounting = np.arctan2(T_base_sonar[1, 0], T_base_sonar[0, 0])
    bearings = np.array([beam.angle for beam in beams]) + mounting
    poses = path.at(stamps + parameters.delay)
    strengths = heard(water, poses, bearings, T_base_sonar[:2, 3], parameters, rng)
    made = placed([replace(beam, intensities=row) for beam, row in zip(beams, strengths)], odometry, T_base_sonar)
    times = np.arange(path.times[0], path.times[-1], 1.0)
    return Recording(made, 0, odometry, Truth(times, path.at(times)[:, :2]))
