"""Finds the basins in which a fine match may start: every pose of a window is scored against a field (Olson 2009)."""

from dataclasses import dataclass
from typing import List

import numpy as np

from mlsm_manager.matching.problem.scan_path import PlanarMotion
from mlsm_manager.matching.problem.state import POSE, POSITION, RATE_YAW, YAW
from mlsm_manager.matching.search.score_field import ScoreField
from node_support.geometry.planar import rotated, wrapped

# rad: a point 20 m away moves by two search cells of 0.5 m.
YAW_STEP = np.radians(2.75)
# A scan has about 150 echoes; a dense one is thinned, so that it takes no longer.
_MOST_POINTS = 160
# m and rad: nearer candidates end in the same fit.
_APART = 2.0
_APART_YAW = np.radians(8.0)


@dataclass(frozen=True)
class SearchWindow:
    """Where to look.

    distance: m to either side in x and y. angle: rad to either side. yaw_rates: (k,) errors of the yaw rate, rad/s.
    """

    distance: float
    angle: float
    yaw_rates: np.ndarray


@dataclass(frozen=True)
class Candidate:
    """A state (8,) as in scan_path, and its score, 0 to 1, less the prior's cost."""

    theta: np.ndarray
    score: float


def search(
    motion: PlanarMotion,
    weights: np.ndarray,
    field: ScoreField,
    center: np.ndarray,
    window: SearchWindow,
    penalty: np.ndarray,
    count: int,
) -> List[Candidate]:
    """Return up to `count` candidates, best first, none of them near a better one.

    weights: (n,) of the scan's points. center: (8,) state in the middle of the window. penalty: (3, 3) matrix A; a pose
    that lies d = (x, y, yaw) from the center loses d^T A d of its score.
    """
    chosen = _thinned(len(weights))
    weights = weights[chosen] / max(weights[chosen].sum(), 1e-12)
    reach = int(np.ceil(window.distance / field.cell))
    steps = int(np.ceil(window.angle / YAW_STEP))
    yaws = np.arange(-steps, steps + 1) * YAW_STEP
    offsets = np.arange(-reach, reach + 1) * field.cell
    prior_cost = _prior_costs(offsets, yaws, penalty)
    scores = np.empty((len(window.yaw_rates), len(yaws), len(offsets), len(offsets)), dtype=np.float32)
    for number, rate in enumerate(window.yaw_rates):
        theta = center.copy()
        theta[RATE_YAW] += rate
        arms = motion.points(motion.path(theta))[chosen] - center[POSITION]
        for index, yaw in enumerate(yaws):
            points = center[POSITION] + rotated(arms, yaw)
            scores[number, index] = field.shifted_sums(points, weights, reach) - prior_cost[index]
    return _peaks(scores, center, window.yaw_rates, yaws, offsets, count)


def _thinned(count: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, _MOST_POINTS)).astype(np.int64))


def _prior_costs(offsets: np.ndarray, yaws: np.ndarray, penalty: np.ndarray) -> np.ndarray:
    yaw, y, x = np.meshgrid(yaws, offsets, offsets, indexing="ij")
    difference = np.stack([x, y, yaw], axis=-1)
    return np.einsum("...a,ab,...b->...", difference, penalty, difference).astype(np.float32)


def _peaks(
    scores: np.ndarray, center: np.ndarray, rates: np.ndarray, yaws: np.ndarray, offsets: np.ndarray, count: int
) -> List[Candidate]:
    best_rate = scores.argmax(axis=0)
    best = np.take_along_axis(scores, best_rate[np.newaxis], axis=0)[0]
    found: List[Candidate] = []
    while len(found) < count:
        index = np.unravel_index(int(best.argmax()), best.shape)
        if not np.isfinite(best[index]):
            break
        theta = np.array(center, dtype=np.float64)
        theta[POSE] += offsets[index[2]], offsets[index[1]], yaws[index[0]]
        theta[RATE_YAW] += rates[best_rate[index]]
        found.append(Candidate(theta, float(best[index])))
        _clear_around(best, index, yaws, offsets)
    return found


def _clear_around(best: np.ndarray, index: tuple, yaws: np.ndarray, offsets: np.ndarray) -> None:
    near = [np.abs(yaws - yaws[index[0]]) < _APART_YAW]
    near += [np.abs(offsets - offsets[axis_index]) < _APART for axis_index in index[1:]]
    best[np.ix_(*[np.flatnonzero(mask) for mask in near])] = -np.inf


def separation(first: np.ndarray, second: np.ndarray) -> float:
    """Return how far apart two states (8,) are: 1 where they differ by what keeps two candidates apart."""
    distance = np.hypot(*(first[POSITION] - second[POSITION])) / _APART
    return float(max(distance, abs(float(wrapped(first[YAW] - second[YAW]))) / _APART_YAW))
