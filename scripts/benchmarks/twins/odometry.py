"""What a DVL and a compass with errors report of a true path."""

import numpy as np
from scipy.signal import lfilter

from benchmarks.twins.parameters import TwinParameters
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import rotated

_HEADING_TIME = 300.0  # s, of the slow compass error
_SPEED_TIME = 12.0  # s, of the speed error
_QUICK_HEADING = (0.0052, 20.0)  # rad, s: what a compass errs by in turns


def reported(path: Track, parameters: TwinParameters, rng: np.random.RandomState) -> Track:
    """Return the odometry of a true path."""
    steps = np.gradient(path.times)
    heading = path.poses[:, 2] + parameters.heading_deviation * lasting(rng, steps, _HEADING_TIME)
    heading = heading + _QUICK_HEADING[0] * lasting(rng, steps, _QUICK_HEADING[1])
    heading = heading + parameters.soft_iron * np.sin(2.0 * path.poses[:, 2])
    heading = heading + parameters.heading_walk * np.cumsum(rng.normal(size=len(steps)) * np.sqrt(np.abs(steps)))
    velocity = rotated(np.gradient(path.poses[:, :2], path.times, axis=0), -path.poses[:, 2] - parameters.direction)
    noise = np.column_stack([lasting(rng, steps, _SPEED_TIME) for _ in range(2)])
    velocity = velocity / (1.0 + parameters.scale) + parameters.speed_deviation * noise
    positions = np.cumsum(rotated(velocity, heading) * steps[:, np.newaxis], axis=0)
    return Track(path.times, np.column_stack([positions - positions[0], heading]))


def lasting(rng: np.random.RandomState, steps: np.ndarray, time: float) -> np.ndarray:
    """Return an Ornstein-Uhlenbeck process (m,) of deviation 1 that forgets within `time` seconds."""
    kept = np.exp(-np.mean(steps) / time)
    noise = rng.normal(size=len(steps)) * np.sqrt(1.0 - kept**2)
    noise[0] = rng.normal()
    return lfilter([1.0], [1.0, -kept], noise)
