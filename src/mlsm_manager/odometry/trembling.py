"""Positions and headings that each err by themselves, as no vehicle moves: found, and smoothed."""

from typing import List, Tuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from mlsm_manager.odometry.steps import Step, StepKind
from mlsm_manager.scan_matching.scan import Track

_TREMBLES = np.array([0.1, 0.1, np.radians(2.0)])  # m, rad: of a pose by itself; DVLs and compasses have a tenth of it
_MOST = 20.0  # m, rad: beyond, poses do not tremble but make no sense
_POSES = 100  # that tell it
_OPPOSED = 0.6  # share of neighbours on opposite sides of a smooth path: .73 by noise, half in waves and turns
_STEADY = 1e-3  # m, rad: noise of poses that do not tremble
_AGILITY = np.array([0.1, 0.1, 0.05])  # m/s/sqrt(s), rad/s/sqrt(s): random walk of a small vehicle's speeds
_OF_NORMAL = 1.48  # standard deviation of normal noise over its median size, which steps do not change


def with_trembling_smoothed(track: Track) -> Tuple[Track, List[Step]]:
    """Return a track whose positions and headings were smoothed where they tremble, and by how much they did; none
    where nowhere.
    """
    poses, noise = track.poses.copy(), np.column_stack([_noise(track.times, column) for column in track.poses.T])
    trembles = (noise > _TREMBLES) & (noise < _MOST)
    for axis in np.flatnonzero(trembles.any(axis=0)):
        own = trembles[:, axis]
        smoothed = _smoothed(track.times, poses[:, axis], np.where(own, noise[:, axis], _STEADY), _AGILITY[axis])
        poses[own, axis] = smoothed[own]
    steps, moves, turns = [], trembles[:, :2].any(axis=1), trembles[:, 2]
    if moves.any():
        size = float(np.median(np.hypot(*noise[moves, :2].T)) / np.sqrt(2.0))
        steps.append(Step(StepKind.SCATTERS, float(track.times[np.argmax(moves)]), size, 0.0))
    if turns.any():
        turn = float(np.median(noise[turns, 2]))
        steps.append(Step(StepKind.TREMBLES, float(track.times[np.argmax(turns)]), 0.0, turn))
    return (track.with_poses(poses), steps) if steps else (track, [])


def _noise(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the standard deviation (m,) of each of `values` (m,) by itself, against those just before and after it.

    Zero where they go on as a vehicle does: then errors of neighbours are as often on one side as on both.
    """
    noise, steps = np.zeros(len(times)), np.diff(times)
    share = steps[1:] / (steps[:-1] + steps[1:])
    expected = share * values[:-2] + (1.0 - share) * values[2:]
    apart = (values[1:-1] - expected) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    edges = np.linspace(0, len(apart), len(apart) // _POSES + 1).astype(int)
    for first, last in zip(edges[:-1], edges[1:]):
        near = apart[first:last]
        if np.mean(near[1:] * near[:-1] < 0.0) > _OPPOSED:
            # Besides its own poses a stretch has the first and the last one of the track, which have one neighbour.
            own = slice(first and first + 1, last + 1 if last < len(apart) else None)
            noise[own] = _OF_NORMAL * np.median(np.abs(near))
    return noise


def _smoothed(times: np.ndarray, values: np.ndarray, noise: np.ndarray, agility: float) -> np.ndarray:
    """Return what is likeliest (m,) by `values` (m,) that err by `noise` (m,), if its rate walks by `agility`."""
    steps = np.diff(times)
    slopes = [1.0 / steps[:-1], -1.0 / steps[:-1] - 1.0 / steps[1:], 1.0 / steps[1:]]
    changes = scipy.sparse.diags(slopes, [0, 1, 2], shape=(len(times) - 2, len(times)))
    weights = scipy.sparse.diags(2.0 / (steps[:-1] + steps[1:]) / agility**2)
    information = scipy.sparse.diags(noise**-2.0) + changes.T @ weights @ changes
    return scipy.sparse.linalg.spsolve(information.tocsc(), values / noise**2)
