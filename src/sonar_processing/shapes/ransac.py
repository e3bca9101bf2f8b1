"""Random sample consensus, many hypotheses at a time (thesis 6.5.5; Fischler and Bolles 1981)."""

import math
from dataclasses import dataclass
from typing import Optional, Protocol

import numpy as np

from node_support.headers import StampParameters
from node_support.parameters import parameter

_BATCH = 500
_FEW_POINTS = 400
_COARSE_POINTS = 250
_SHARE_LOOKED_AT_AGAIN = 0.1


@dataclass(frozen=True)
class RansacParameters(StampParameters):
    """What the searches for lines and for circles share."""

    distance: float = parameter(
        0.5, "an echo this near to a shape belongs to it", unit="m", low=0.001, high=100.0, thesis_name="RANSACDistance"
    )
    probability: float = parameter(
        0.999, "the search ends early once it would have found a better shape with this probability; 1: never early",
        low=0.0, high=1.0, thesis_name="RANSACProbability",
    )  # fmt: skip
    max_iterations: int = parameter(
        5000, "hypotheses for one shape, at most", low=1, high=1000000, thesis_name="RANSACMaxIterations"
    )
    echo_gap: float = parameter(
        0.5, "bins of a beam this near to each other are one echo; 0: every point counts", unit="m", low=0.0, high=10.0
    )
    min_echo_share: float = parameter(
        0.15, "an echo with fewer bins than this share of the usual echo counts as noise", low=0.0, high=1.0
    )
    sonar_frame: str = parameter("sonar", "frame of the sonar in tf", tunable=False)
    seed: int = parameter(1, "seed of the random hypotheses: same seed and scan, same shapes", low=0, high=2**31 - 1)


class Model(Protocol):
    """A kind of shape and the points it is looked for in."""

    points: np.ndarray

    def hypotheses(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Return at most `number` shapes (h, k) through random samples of the points; impossible ones are left out."""

    def scores(self, hypotheses: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return for shapes (h, k) how many of the points (n, 2) speak for each of them."""

    def good_share(self, score: float) -> float:
        """Return which share of all samples consists of points of a shape with that score."""


def best_hypothesis(model: Model, parameters: RansacParameters, rng: np.random.Generator) -> Optional[np.ndarray]:
    """Return the shape (k,) with the highest score, or None where none can be made or none is spoken for.

    The search ends after `max_iterations`, or when a better shape would have been met with `probability` already. In
    large clouds every hypothesis is scored on some of the points and the best of them on all (preemptive RANSAC,
    Nister 2003).
    """
    count = len(model.points)
    coarse = model.points if count <= _FEW_POINTS else model.points[rng.choice(count, _COARSE_POINTS, replace=False)]
    best, best_score, done, wanted = None, 0.0, 0, float(parameters.max_iterations)
    while done < min(wanted, parameters.max_iterations):
        batch = min(_BATCH, parameters.max_iterations - done)
        shapes = model.hypotheses(batch, rng)
        done += batch
        if not len(shapes):
            continue
        shapes, scores = _scored(model, shapes, coarse)
        winner = int(np.argmax(scores))
        if scores[winner] > best_score:
            best, best_score = shapes[winner], float(scores[winner])
            wanted = iterations_wanted(model.good_share(best_score), parameters.probability)
    return best


def _scored(model: Model, shapes: np.ndarray, coarse: np.ndarray) -> tuple:
    scores = model.scores(shapes, coarse)
    if coarse is model.points:
        return shapes, scores
    keep = max(int(_SHARE_LOOKED_AT_AGAIN * len(shapes)), 1)
    shapes = shapes[np.argpartition(scores, -keep)[-keep:]]
    return shapes, model.scores(shapes, model.points)


def iterations_wanted(good_share: float, probability: float) -> float:
    """Return how many samples hold a good one with `probability`, when `good_share` of all samples are good."""
    if good_share >= 1.0:
        return 1.0
    if good_share <= 0.0 or probability >= 1.0:
        return math.inf
    return math.log1p(-probability) / math.log1p(-good_share)
