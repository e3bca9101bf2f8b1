"""Buoys and upright pipes: circles in a horizontal scan (thesis 6.5.5)."""

from dataclasses import dataclass, replace
from typing import Callable, Iterator, List, Optional, Tuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from node_support.geometry import bearings_of
from node_support.parameters import ParameterError, parameter
from sonar_processing.beams.parameters import beam_width_parameter
from sonar_processing.cloud import Cloud
from sonar_processing.shapes.echoes import (
    Sightings,
    beam_echoes,
    footprint,
    is_alone,
    is_oblique,
    is_scattered,
    sightings,
    wall_echoes,
)
from sonar_processing.shapes.lines import fitted_line
from sonar_processing.shapes.ransac import RansacParameters, best_hypothesis

# Returns the sonar's place (m, 2) x y [m], in the cloud's frame, at times (m,) [s], NaN where it is not known.
SonarPositions = Callable[[np.ndarray], np.ndarray]
# The next beam of a wall meets it at most so many times as far away as the last one, unless the wall is nearly in line
# with the beams.
_NEXT_BEAM = 1.5
_PENALTY = 4  # One echo too near to a circle outweighs so many on it: more than beams that a small thing fills
# Echoes that graze a buoy at 10 m lie as nearly on a line as on the circle, five of them where a turning vehicle sees
# it twice; from six on the better fit decides.
_LINE_ECHOES = 6
# Echoes of a near side bulge towards the sonar. Noise, and a vehicle that moves between them, makes them as hollow as
# this, in metres; a niche or a corner of walls is deeper.
_HOLLOW = 0.25
# Radii tried for a pair of echoes; more tell nothing new, and clouds with few pairs need not be searched for long.
_RADII_PER_PAIR = 100
_RAYS = 9  # across a beam's width
_RANGE_DEVIATION, _BEARING_DEVIATION = 0.1, 0.15  # m, standard deviations of a range and, across, of a bearing


@dataclass(frozen=True)
class CircleDetectorParameters(RansacParameters):
    n_circles: int = parameter(10, "circles looked for in a scan, at most", low=1, high=100)
    min_radius: float = parameter(0.2, "smallest radius of a circle", unit="m", low=0.01, high=100.0)
    max_radius: float = parameter(0.6, "largest radius of a circle", unit="m", low=0.01, high=100.0)
    min_inliers: int = parameter(2, "echoes that make a circle, each of another beam", low=2, high=10000)
    clearance: float = parameter(
        0.7, "least distance of a circle from all other echoes; what is nearer is taken for a piece of a wall",
        unit="m", low=0.0, high=100.0,
    )  # fmt: skip
    line_distance: float = parameter(
        0.2, "an echo this near to a line through echoes of the neighbouring beams belongs to a wall",
        unit="m", low=0.0, high=100.0,
    )  # fmt: skip
    max_residual: float = parameter(
        0.2, "largest root mean square difference between a circle's ranges and the measured ones",
        unit="m", low=0.0, high=100.0,
    )  # fmt: skip
    max_footprint: float = parameter(
        1.65,
        "largest width that two neighbouring beams cover at a circle; beyond it a circle may be the end of a wall",
        unit="m", low=0.0, high=100.0,
    )  # fmt: skip
    beam_width: float = beam_width_parameter()

    def check(self) -> None:
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

    def __init__(self, seen: Sightings, others: np.ndarray, parameters: CircleDetectorParameters) -> None:
        """`seen`: the echoes that may make a circle; `others` (k, 2) x y [m]: those that may not."""
        self.points = seen.points
        self._others = others
        self._towards = seen.towards
        self._parameters = parameters
        self._pairs = cKDTree(seen.points).query_pairs(2.0 * parameters.max_radius, output_type="ndarray")
        self.enough = _RADII_PER_PAIR * len(self._pairs)
        spacing = seen.step * seen.ranges
        # Where a thing is narrower than the beams are apart, two echoes side by side come from two turns of the head.
        self._next_beam = np.where(spacing > 2.0 * parameters.max_radius, _NEXT_BEAM * spacing, 0.0)

    def hypotheses(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Return circles (n, 4) of random allowed radius through two points each, behind them as the sonar sees it."""
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
        next_beam = np.maximum(self._next_beam[samples[possible, 0]], _NEXT_BEAM * 2.0 * np.sqrt(square))
        apart = np.maximum(self._parameters.clearance, next_beam)
        return np.column_stack([centers, radius, self._parameters.distance + apart])

    def scores(self, hypotheses: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return (n,) how many `points` (k, 2) lie on each circle, less a penalty for those too near to it."""
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
        """Return the indices (m,) of the points on a circle (4,)."""
        from_center = _distances(circle[np.newaxis], self.points)[0]
        return np.flatnonzero(np.abs(from_center - circle[2]) <= self._parameters.distance)


def _distances(circles: np.ndarray, points: np.ndarray) -> np.ndarray:
    difference = points[np.newaxis] - circles[:, np.newaxis, :2]
    return np.hypot(difference[..., 0], difference[..., 1])


class CircleDetector:
    """Finds circles one after the other, the best first, each without the echoes of those before."""

    def __init__(self, parameters: CircleDetectorParameters) -> None:
        self.parameters = parameters

    def __call__(self, cloud: Cloud, sonar_positions: SonarPositions) -> List[Circle]:
        """Return the circles of a scan, none where there are too few echoes."""
        echoes = beam_echoes(cloud, self.parameters.echo_gap)
        strong = echoes.strong(self.parameters.min_echo_share)
        if not len(strong):
            return []
        origins = sonar_positions(echoes.time_stamps)
        known = np.flatnonzero(np.isfinite(origins).all(axis=1))
        everything, is_strong = sightings(echoes, known, origins[known]), np.isin(known, strong)
        seen, weak = everything.only(np.flatnonzero(is_strong)), everything.only(np.flatnonzero(~is_strong))
        found = []
        for inliers in self._groups(seen):
            fit = self._fit(seen.only(inliers)) if self._is_own_thing(seen, inliers, weak) else None
            if fit is not None:
                center, radius, residual = fit
                members = echoes.members[np.isin(echoes.owner, known[is_strong][inliers])]
                found.append(Circle(center, radius, members, len(inliers), residual))
        return found

    def _is_own_thing(self, seen: Sightings, inliers: np.ndarray, weak: Sightings) -> bool:
        """Return whether a group of echoes cannot be a piece of a wall or of the floor."""
        parameters, group = self.parameters, seen.only(inliers)
        if footprint(group, parameters.beam_width) > parameters.max_footprint:
            return False
        if is_oblique(group) or is_scattered(group, seen):
            return False
        others = seen.only(np.setdiff1d(np.arange(len(seen.points)), inliers))
        return is_alone(group, others, weak, parameters.clearance)

    def _groups(self, seen: Sightings) -> Iterator[np.ndarray]:
        """Yield the indices of the echoes that stand together apart from all others, best group first."""
        parameters, rng = self.parameters, np.random.default_rng(self.parameters.seed)
        free = ~wall_echoes(seen, 2.0 * parameters.max_radius, parameters.line_distance)
        for _ in range(parameters.n_circles):
            if np.count_nonzero(free) < parameters.min_inliers:
                return
            inliers = self._best_group(seen, free, rng)
            if inliers is None:
                return
            free[inliers] = False
            yield inliers

    def _best_group(self, seen: Sightings, free: np.ndarray, rng: np.random.Generator) -> Optional[np.ndarray]:
        left = np.flatnonzero(free)
        model = CircleModel(seen.only(left), seen.points[~free], self.parameters)
        search = replace(self.parameters, max_iterations=max(min(self.parameters.max_iterations, model.enough), 1))
        circle = best_hypothesis(model, search, rng)
        if circle is None or model.scores(circle[np.newaxis], model.points)[0] < self.parameters.min_inliers:
            return None
        return left[model.inliers(circle)]

    def _fit(self, seen: Sightings) -> Optional[Tuple[np.ndarray, float, float]]:
        """Return a group's circle as fitted_circle does; None where a line explains it better or its ranges do not."""
        parameters = self.parameters
        if len(np.unique(seen.beams)) < parameters.min_inliers or hollow_depth(seen) > _HOLLOW:
            return None
        fit = fitted_circle(seen, parameters)
        if fit[-1] > parameters.max_residual:
            return None
        if len(seen.weights) >= _LINE_ECHOES:
            line = fitted_line(seen.points, seen.weights)
            if float(np.sqrt(np.mean((seen.points @ line[:2] - line[2]) ** 2))) <= fit[-1]:
                return None
        return fit


def hollow_depth(seen: Sightings) -> float:
    """Return how much farther than the outer two the echoes between them are, m; 0 with fewer than three."""
    if len(seen.points) < 3:
        return 0.0
    outward = seen.towards.mean(axis=0)
    depth = (seen.points @ outward)[np.argsort(seen.points @ np.array([-outward[1], outward[0]]))]
    return float(depth[1:-1].mean() - depth[[0, -1]].mean())


def fitted_circle(seen: Sightings, parameters: CircleDetectorParameters) -> Tuple[np.ndarray, float, float]:
    """Return center (2,), radius and residual [m] of the circle that explains ranges and bearings best.

    A buoy at 10 m is as wide as two or three beams. Each beam that grazes it is drawn on its own axis, beside the
    buoy, so that points do not lie on the circle; what a beam measures is the mean range of the part of the circle
    that it covers. That is compared, and the bearing: the mean of the beams' bearings, weighted by their echoes.
    What the echoes leave open (the radius, for far things) stays near the middle of the allowed radii. The residual is
    the root mean square difference of ranges.
    """
    min_radius, max_radius = parameters.min_radius, parameters.max_radius
    middle, half = (min_radius + max_radius) / 2.0, max((max_radius - min_radius) / 2.0, 1e-6)
    origin = seen.weights @ seen.origins / seen.weights.sum()
    point = seen.weights @ seen.points / seen.weights.sum()
    outward = (point - origin) / max(np.linalg.norm(point - origin), 1e-9)
    sideways = np.array([-outward[1], outward[0]])

    def residuals(unknown: np.ndarray) -> np.ndarray:
        center = point + unknown[0] * outward + unknown[1] * sideways
        ranges = range_differences(seen.points, seen.origins, center, unknown[2], parameters.beam_width)
        return np.concatenate(
            [ranges / _RANGE_DEVIATION, [unknown[1] / _BEARING_DEVIATION, (unknown[2] - middle) / half]]
        )

    low, high = [-max_radius, -max_radius, middle - half], [3.0 * max_radius, max_radius, middle + half]
    solution = least_squares(residuals, [0.8 * middle, 0.0, middle], bounds=(low, high)).x
    center = point + solution[0] * outward + solution[1] * sideways
    differences = range_differences(seen.points, seen.origins, center, solution[2], parameters.beam_width)
    return center, float(solution[2]), float(np.sqrt(np.mean(differences**2)))


def range_differences(
    points: np.ndarray, origins: np.ndarray, center: np.ndarray, radius: float, beam_width: float
) -> np.ndarray:
    """Return (n,) measured range minus the mean range of the part of the circle that the beam covers, m.

    points: (n, 2) of the echoes; origins: (n, 2) of the sonar, x y [m]. A ray that passes the circle counts as if it
    met it where they are nearest.
    """
    measured, to_center = points - origins, center - origins
    ranges = np.hypot(measured[:, 0], measured[:, 1])
    bearings = bearings_of(measured) - bearings_of(to_center)
    rays = bearings[:, np.newaxis] + np.linspace(-0.5, 0.5, _RAYS) * beam_width
    distance = np.hypot(to_center[:, 0], to_center[:, 1])[:, np.newaxis]
    beside = distance * np.sin(rays)
    hits = np.abs(beside) < radius
    hits |= np.abs(beside) <= np.abs(beside).min(axis=1, keepdims=True)
    near_side = distance * np.cos(rays) - np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
    return ranges - (near_side * hits).sum(axis=1) / hits.sum(axis=1)
