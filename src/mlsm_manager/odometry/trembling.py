"""Headings that each err by themselves, as no vehicle turns: found, and smoothed."""

from typing import List, Tuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from mlsm_manager.odometry.steps import Step, StepKind
from mlsm_manager.scan_matching.scan import Track

_TREMBLES = np.radians(2.0)  # standard deviation of each heading by itself: compasses have a tenth of it
_POSES = 100  # that tell it
_OPPOSED = 0.6  # share of neighbours on opposite sides of a smooth heading: .73 by noise, half in waves and turns
_STEADY = 1e-3  # rad: noise of headings that do not tremble
_AGILITY = 0.05  # rad/s/sqrt(s): random walk of the turn rate of a small vehicle
_YAW = 2  # column of poses


def with_headings_smoothed(track: Track) -> Tuple[Track, List[Step]]:
    """Return a track whose headings were smoothed where they tremble, and by how much they did; none where nowhere."""
    noise = _noise(track)
    trembles = noise > _TREMBLES
    if not trembles.any():
        return track, []
    poses = track.poses.copy()
    smoothed = _smoothed(track.times, poses[:, _YAW], np.where(trembles, noise, _STEADY))
    poses[trembles, _YAW] = smoothed[trembles]
    begin = float(track.times[np.argmax(trembles)])
    return track.with_poses(poses), [Step(StepKind.TREMBLES, begin, 0.0, float(np.median(noise[trembles])))]


def _noise(track: Track) -> np.ndarray:
    """Return the standard deviation (m,) [rad] of each heading by itself, against those just before and after it.

    Zero where headings go on as a vehicle turns: then errors of neighbours are as often on one side as on both.
    """
    noise, steps = np.zeros(len(track.times)), np.diff(track.times)
    share = steps[1:] / (steps[:-1] + steps[1:])
    expected = share * track.poses[:-2, _YAW] + (1.0 - share) * track.poses[2:, _YAW]
    apart = (track.poses[1:-1, _YAW] - expected) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    edges = np.linspace(0, len(apart), len(apart) // _POSES + 1).astype(int)
    for first, last in zip(edges[:-1], edges[1:]):
        near = apart[first:last]
        if np.mean(near[1:] * near[:-1] < 0.0) > _OPPOSED:
            # Besides its own poses a stretch has the first and the last one of the track, which have one neighbour.
            own = slice(first and first + 1, last + 1 if last < len(apart) else None)
            noise[own] = 1.253 * np.abs(near).mean()
    return noise


def _smoothed(times: np.ndarray, yaws: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Return headings (m,) [rad] of a turn rate that walks, likeliest by `yaws` (m,) that err by `noise` (m,)."""
    steps = np.diff(times)
    slopes = [1.0 / steps[:-1], -1.0 / steps[:-1] - 1.0 / steps[1:], 1.0 / steps[1:]]
    changes = scipy.sparse.diags(slopes, [0, 1, 2], shape=(len(times) - 2, len(times)))
    weights = scipy.sparse.diags(2.0 / (steps[:-1] + steps[1:]) / _AGILITY**2)
    information = scipy.sparse.diags(noise**-2.0) + changes.T @ weights @ changes
    return scipy.sparse.linalg.spsolve(information.tocsc(), yaws / noise**2)
