"""Conditions of twins of a recorded run: true paths made from the recorded one, and what odometry reports of a path."""

from dataclasses import dataclass
from typing import Callable

import numpy as np
from scipy.signal import lfilter

from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import rotated


def mirrored(poses: np.ndarray) -> np.ndarray:
    return poses * np.array([1.0, -1.0, -1.0])


def turned_round(poses: np.ndarray) -> np.ndarray:
    return poses[::-1]


def end_first(poses: np.ndarray) -> np.ndarray:
    """Return the part after 45 % of the run, then the earlier one moved to where the later one ended."""
    start = int(0.45 * len(poses))
    later, earlier = poses[start:], poses[:start]
    return np.concatenate([later, earlier + (later[-1] - earlier[0])])


def there_and_back(poses: np.ndarray) -> np.ndarray:
    """Return the first half of the path, and the same way home."""
    half = len(poses) // 2
    home = poses[:half][::-1]
    return np.concatenate([poses[:half], home, np.repeat(home[-1:], len(poses) - 2 * half, axis=0)])


@dataclass(frozen=True)
class TwinParameters:
    """Conditions of a twin. Angles in rad, lengths in m, times in s.

    path: what is made of the recorded poses (m, 3). direction, scale: errors of the odometry. range_scale: true range
    over reported range, minus 1. delay: beams are taken this much after their stamps. heading_deviation: of the
    compass, lasting 300 s. heading_walk: rad/sqrt(s), by which the compass drifts besides. speed_deviation: m/s,
    lasting 12 s. strength: level [dB] of an echo at 10 m. half_width: of the beam at half power. echo_length: of a
    plateau, m per 10 dB above the threshold. objects: piers, boats and posts. clutter: share of beams with a false
    echo. basin_radius, canal_radius: m of water kept free. rotation: of the path. binary: strengths are 0 or 127, else
    graded. soft_iron: of the compass, amplitude of an error that turns twice with the heading. scale_walk: 1/sqrt(s),
    by which the scale changes besides. current: m/s along +x, which the odometry does not feel.
    """

    seed: int = 1
    path: Callable[[np.ndarray], np.ndarray] = np.array
    rotation: float = 0.0
    direction: float = 0.07
    scale: float = 0.005
    range_scale: float = -0.01
    delay: float = 0.6
    heading_deviation: float = 0.01745
    heading_walk: float = 0.0
    speed_deviation: float = 0.025
    strength: float = 26.0
    half_width: float = 0.0227
    echo_length: float = 1.2
    objects: int = 60
    clutter: float = 0.06
    basin_radius: float = 20.0
    canal_radius: float = 11.0
    binary: bool = True
    soft_iron: float = 0.0
    scale_walk: float = 0.0
    current: float = 0.0


TWINS = {
    "as_recorded": TwinParameters(1),
    "mounted_aslant": TwinParameters(3, direction=0.1745),
    "mirrored": TwinParameters(11, mirrored, 0.7, direction=0.1745, scale=-0.012, delay=0.9),
    "reversed": TwinParameters(12, turned_round, 2.1, direction=-0.14, range_scale=0.03, delay=-0.3),
    "end_first": TwinParameters(13, end_first, -1.3, direction=0.05, scale=0.015, range_scale=-0.02),
    "there_and_back": TwinParameters(14, there_and_back, 0.4, direction=-0.10, scale=0.01, delay=0.2),
    "poor_compass": TwinParameters(15, rotation=1.0, heading_deviation=0.035, heading_walk=0.001, direction=0.03),
    "weak": TwinParameters(16, rotation=2.5, strength=20.0, objects=25, clutter=0.12, direction=-0.06, echo_length=2.0),
    "wide_beam": TwinParameters(17, rotation=-0.5, half_width=0.04, basin_radius=26.0, canal_radius=15.0, delay=1.0),
    "soft_iron": TwinParameters(19, rotation=0.3, soft_iron=0.07, direction=-0.05),
    "short_odometry": TwinParameters(20, rotation=1.7, scale=0.05, direction=0.09),
    "late": TwinParameters(21, rotation=-2.2, delay=1.5, direction=0.04),
    "warm": TwinParameters(22, rotation=2.9, range_scale=0.03, scale=-0.01, direction=-0.08),
    "open": TwinParameters(25, rotation=1.3, basin_radius=70.0, canal_radius=70.0, objects=8, direction=0.06),
    "graded": TwinParameters(18, mirrored, 3.0, binary=False, direction=0.08, range_scale=0.015, scale=-0.01),
}


def true_path(recorded: Track, parameters: TwinParameters) -> Track:
    """Return the twin's path at the recording's times; it begins at the origin."""
    poses = parameters.path(recorded.poses)
    poses = poses - np.array([*poses[0, :2], 0.0])
    positions = rotated(poses[:, :2], np.full(len(poses), parameters.rotation))
    return Track(recorded.times, np.column_stack([positions, poses[:, 2] + parameters.rotation]))


_HEADING_TIME = 300.0  # s, of the slow compass error
_SPEED_TIME = 12.0  # s, of the speed error
_QUICK_HEADING = (0.0052, 20.0)  # rad, s: what a compass errs by in turns


def reported(path: Track, parameters: TwinParameters, rng: np.random.RandomState) -> Track:
    """Return the odometry of a true path."""
    steps = np.gradient(path.times)
    heading = path.poses[:, 2] + parameters.heading_deviation * lasting(rng, steps, _HEADING_TIME)
    heading = heading + _QUICK_HEADING[0] * lasting(rng, steps, _QUICK_HEADING[1])
    heading = heading + parameters.soft_iron * np.sin(2.0 * path.poses[:, 2])
    heading = heading + parameters.heading_walk * _walk(rng, steps)
    through_water = np.gradient(path.poses[:, :2], path.times, axis=0) - [parameters.current, 0.0]
    velocity = rotated(through_water, -path.poses[:, 2] - parameters.direction)
    noise = np.column_stack([lasting(rng, steps, _SPEED_TIME) for _ in range(2)])
    scale = np.full((len(steps), 1), 1.0 + parameters.scale)
    if parameters.scale_walk:
        scale[:, 0] += parameters.scale_walk * _walk(rng, steps)
    velocity = velocity / scale + parameters.speed_deviation * noise
    positions = np.cumsum(rotated(velocity, heading) * steps[:, np.newaxis], axis=0)
    return Track(path.times, np.column_stack([positions - positions[0], heading]))


def _walk(rng: np.random.RandomState, steps: np.ndarray) -> np.ndarray:
    """Return a random walk (m,) of deviation 1 after a second; steps: (m,) s."""
    return np.cumsum(rng.normal(size=len(steps)) * np.sqrt(np.abs(steps)))


def lasting(rng: np.random.RandomState, steps: np.ndarray, time: float) -> np.ndarray:
    """Return an Ornstein-Uhlenbeck process (m,) of deviation 1 that forgets within `time` seconds."""
    kept = np.exp(-np.mean(steps) / time)
    noise = rng.normal(size=len(steps)) * np.sqrt(1.0 - kept**2)
    noise[0] = rng.normal()
    return lfilter([1.0], [1.0, -kept], noise)
