"""What a scanning sonar with a beam of some width hears in a raster of water.

Near and square-on, a strong echo is heard over most of the beam's width; far or aslant only near its axis. So the
width that a beam seems to have depends on the strength of what it hears.
"""

from typing import Tuple

import numpy as np

from benchmarks.twins.parameters import TwinParameters
from benchmarks.twins.water import Water
from node_support.geometry import rotated

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
