"""Buoys and upright pipes: circles in a horizontal scan (thesis 6.5.5)."""

from dataclasses import dataclass
from typing import Callable, List, Optional

import numpy as np
from scipy.spatial import cKDTree

from node_support.parameters import ParameterError, parameter
from sonar_processing.beams.beam_width import beam_width_parameter
from sonar_processing.cloud import IntensityCloud
from sonar_processing.shapes.beam_echoes import BeamEchoes, beam_echoes
from sonar_processing.shapes.circle_fit import CircleSight, fitted_circle
from sonar_processing.shapes.ransac import RansacParameters, best_hypothesis

SonarPositions = Callable[[np.ndarray], np.ndarray]
"""Returns the sonar's place (m, 2) x y [m], in the cloud's frame, at times (m,) [s], NaN where it is not known."""

_NEXT_BEAM = 1.5
_PENALTY = 4


@dataclass(frozen=True)
class CircleDetectorParameters(RansacParameters):
    """Parameters of circle_detector."""

    n_circles: int = parameter(10, "circles looked for in a scan, at most", low=1, high=100)
    min_radius: float = parameter(0.2, "of a circle", unit="m", low=0.01, high=100.0)
    max_radius: float = parameter(0.6, "of a circle", unit="m", low=0.01, high=100.0)
    min_inliers: int = parameter(2, "echoes that make a circle, each of another beam", low=2, high=10000)
    clearance: float = parameter(
        0.7,
        "a circle stands at least this far from all other echoes, or it is a piece of a wall",
        unit="m",
        low=0.0,
        high=100.0,
    )
    beam_width: float = beam_width_parameter()

    def check(self) -> None:
        """Refuse radii in the wrong order."""
        if self.min_radius > self.max_radius:
            raise ParameterError(f"min_radius = {self.min_radius}: must be at most max_radius = {self.max_radius}")


@dataclass(frozen=True)
class Circle:
    """A circle found in a cloud, in the cloud's frame.

    center: (2,) x y [m]; radius: m. members: (k,) indices of the cloud's points in it; echoes: number of echoes they
    make. residual: root mean square difference of the echoes' ranges from those the circle would give, m.
    """

    center: np.ndarray
    radius: float
    members: np.ndarray
    echoes: int
    residual: float


class CircleModel:
    """Circles as rows (center x, center y, radius, distance kept by all else) whose near side the sonar sees."""

    def __init__(
        self, points: np.ndarray, others: np.ndarray, towards: np.ndarray, parameters: CircleDetectorParameters
    ) -> None:
        """`others` (k, 2): echoes that belong to no new circle; `towards` (n, 2): unit vectors from the sonar."""
        self.points = points
        self._others = others
        self._towards = towards
        self._parameters = parameters
        self._pairs = cKDTree(points).query_pairs(2.0 * parameters.max_radius, output_type="ndarray")

    def hypotheses(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Return the circles of random allowed radius through two points each, behind them as the sonar sees it."""
        if not len(self._pairs):
            return np.empty((0, 4))
        samples = self._pairs[rng.integers(0, len(self._pairs), number)]
        radius = rng.uniform(self._parameters.min_radius, self._parameters.max_radius, len(samples))
        first, second = self.points[samples[:, 0]], self.points[samples[:, 1]]
        half = (second - first) / 2.0
        square = np.einsum("ij,ij->i", half, half)
        possible = (square < radius**2) & (square > 0.0)
        half, radius, square = half[possible], radius[possible], square[possible]
        behind = np.column_stack([-half[:, 1], half[:, 0]]) / np.sqrt(square)[:, np.newaxis]
        behind *= np.sign(np.einsum("ij,ij->i", behind, self._towards[samples[possible, 0]]))[:, np.newaxis]
        centers = first[possible] + half + behind * np.sqrt(radius**2 - square)[:, np.newaxis]
        apart = np.maximum(self._parameters.clearance, _NEXT_BEAM * 2.0 * np.sqrt(square))
        return np.column_stack([centers, radius, self._parameters.distance + apart])

    def scores(self, hypotheses: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return how many points lie on each circle, less a penalty for those that stand too near to it."""
        radius, apart = hypotheses[:, 2:3], hypotheses[:, 3:]
        from_center = _distances(hypotheses, points)
        on = np.abs(from_center - radius) <= self._parameters.distance
        near = np.count_nonzero((from_center <= radius + apart) & ~on, axis=1)
        near += np.count_nonzero(_distances(hypotheses, self._others) <= radius + apart, axis=1)
        return np.count_nonzero(on, axis=1) - _PENALTY * near

    def good_share(self, score: float) -> float:
        """Return which share of the pairs lies on a circle of that many points, neighbours at least."""
        return (score - 1.0) / len(self._pairs)

    def inliers(self, circle: np.ndarray) -> np.ndarray:
        """Return the indices of the points on a circle."""
        from_center = _distances(circle[np.newaxis], self.points)[0]
        return np.flatnonzero(np.abs(from_center - circle[2]) <= self._parameters.distance)


def _distances(circles: np.ndarray, points: np.ndarray) -> np.ndarray:
    difference = points[np.newaxis] - circles[:, np.newaxis, :2]
    return np.hypot(difference[..., 0], difference[..., 1])


class CircleDetector:
    """Finds circles one after the other, the best first, each without the echoes of those before."""

    def __init__(self, parameters: CircleDetectorParameters) -> None:
        self.parameters = parameters

    def __call__(self, cloud: IntensityCloud, sonar_positions: SonarPositions) -> List[Circle]:
        """Return the circles of a scan, none where there are too few echoes."""
        echoes = beam_echoes(cloud, self.parameters.echo_gap)
        rng = np.random.default_rng(self.parameters.seed)
        strong = echoes.strong(self.parameters.min_echo_share)
        origins = sonar_positions(echoes.time_stamps) if len(strong) else np.empty((0, 2))
        free = np.zeros(len(echoes), dtype=bool)
        free[strong] = np.isfinite(origins[strong]).all(axis=1)
        circles: List[Circle] = []
        while len(circles) < self.parameters.n_circles and np.count_nonzero(free) >= self.parameters.min_inliers:
            inliers = self._best_circle(echoes.points, origins, free, strong, rng)
            if inliers is None:
                break
            if len(np.unique(echoes.time_stamps[inliers])) >= self.parameters.min_inliers:
                circles.append(self._circle(echoes, origins, inliers))
            free[inliers] = False
        return circles

    def _best_circle(
        self, points: np.ndarray, origins: np.ndarray, free: np.ndarray, strong: np.ndarray, rng: np.random.Generator
    ) -> Optional[np.ndarray]:
        left, taken = np.flatnonzero(free), strong[~free[strong]]
        towards = points[left] - origins[left]
        towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-9)
        model = CircleModel(points[left], points[taken], towards, self.parameters)
        circle = best_hypothesis(model, self.parameters, rng)
        if circle is None or model.scores(circle[np.newaxis], model.points)[0] < self.parameters.min_inliers:
            return None
        return left[model.inliers(circle)]

    def _circle(self, echoes: BeamEchoes, origins: np.ndarray, inliers: np.ndarray) -> Circle:
        parameters = self.parameters
        sight = CircleSight(
            echoes.points[inliers], origins[inliers], echoes.weights[inliers].astype(float), parameters.beam_width
        )
        fit = fitted_circle(sight, parameters.min_radius, parameters.max_radius)
        members = echoes.members[np.isin(echoes.owner, inliers)]
        return Circle(fit.center, fit.radius, members, len(inliers), fit.residual)
