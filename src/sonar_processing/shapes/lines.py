"""Walls: straight lines in a horizontal scan (thesis 6.5.5)."""

from dataclasses import dataclass
from typing import List, Optional

import numpy as np

from node_support.parameters import parameter
from sonar_processing.cloud import Cloud
from sonar_processing.shapes.echoes import BeamEchoes, beam_echoes
from sonar_processing.shapes.ransac import RansacParameters, best_hypothesis

_REFITS = 5
_PARTS = 8


@dataclass(frozen=True)
class LineDetectorParameters(RansacParameters):
    n_walls: int = parameter(4, "walls looked for in a scan, at most", low=1, high=100, thesis_name="nWalls")
    min_inliers: int = parameter(6, "echoes that make a wall", low=2, high=10000)
    min_length: float = parameter(4.0, "a wall is at least this long", unit="m", low=0.0, high=1000.0)
    max_gap: float = parameter(
        25.0, "echoes farther apart along a wall than this belong to different walls", unit="m", low=0.01, high=1000.0
    )
    min_coverage: float = parameter(
        0.5,
        "least share of the eight equal parts of a wall that hold echoes, so that two things far apart make no wall",
        low=0.0,
        high=1.0,
    )


@dataclass(frozen=True)
class Line:
    """A wall found in a cloud, in the cloud's frame.

    normal: (2,) unit vector; offset: m; the wall's points fulfil normal . (x, y) = offset >= 0.
    ends: (2, 2) x y [m], the feet of the outermost inliers on the line.
    members: (k,) indices of the cloud's points in it; echoes: number of echoes they make.
    residual: root mean square distance of the echoes from the line, m.
    """

    normal: np.ndarray
    offset: float
    ends: np.ndarray
    members: np.ndarray
    echoes: int
    residual: float

    @property
    def orientation(self) -> float:
        """Direction of the normal, from the frame's origin to the wall, rad."""
        return float(np.arctan2(self.normal[1], self.normal[0]))

    @property
    def length(self) -> float:
        """From end to end, m."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    def distance_from(self, point: np.ndarray) -> float:
        """Return the distance of a point (2,) [m] from the line."""
        return abs(float(self.normal @ point) - self.offset)


class LineModel:
    """Lines as rows (normal x, normal y, offset)."""

    def __init__(self, points: np.ndarray, distance: float) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float32)
        self._distance = distance

    def hypotheses(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Return lines (n, 3) through two points each; two points in one place make none."""
        count = len(self.points)
        first, second = rng.integers(0, count, number), rng.integers(1, max(count, 2), number)
        first, second = self.points[first], self.points[(first + second) % count]
        along = second - first
        length = np.hypot(along[:, 0], along[:, 1])
        distinct = length > self._distance
        normals = np.column_stack([-along[:, 1], along[:, 0]])[distinct] / length[distinct, np.newaxis]
        return np.column_stack([normals, np.einsum("ij,ij->i", normals, first[distinct])])

    def scores(self, hypotheses: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return (n,) how many of `points` (k, 2) are near each line."""
        distances = hypotheses[:, :2] @ points.T
        distances -= hypotheses[:, 2:]
        return np.count_nonzero(np.abs(distances, out=distances) <= self._distance, axis=1)

    def good_share(self, score: float) -> float:
        """Return which share of all pairs has both points on a line of that many."""
        return (score / len(self.points)) ** 2


class LineDetector:
    """Finds walls one after the other, the best first, each without the echoes of those before."""

    def __init__(self, parameters: LineDetectorParameters) -> None:
        self.parameters = parameters

    def __call__(self, cloud: Cloud) -> List[Line]:
        """Return the walls of a scan, none where there are too few echoes."""
        echoes = beam_echoes(cloud, self.parameters.echo_gap)
        rng = np.random.default_rng(self.parameters.seed)
        left = echoes.strong(self.parameters.min_echo_share)
        walls: List[Line] = []
        while len(walls) < self.parameters.n_walls and len(left) >= self.parameters.min_inliers:
            inliers = self._best_line(echoes.points[left], echoes.weights[left], rng)
            if inliers is None:
                break
            wall = self._line(echoes, left[inliers])
            if wall is not None:
                walls.append(wall)
            left = np.delete(left, inliers)
        return walls

    def _best_line(self, points: np.ndarray, weights: np.ndarray, rng: np.random.Generator) -> Optional[np.ndarray]:
        """Return the indices of the inliers of the best line, refitted to all of them, in one stretch of wall."""
        center = points.mean(axis=0)
        points = points - center
        line = best_hypothesis(LineModel(points, self.parameters.distance), self.parameters, rng)
        if line is None:
            return None
        inliers = self._stretch(points, line)
        for _ in range(_REFITS):
            if len(inliers) < self.parameters.min_inliers:
                return None
            refitted = self._stretch(points, fitted_line(points[inliers], weights[inliers]))
            if np.array_equal(refitted, inliers):
                break
            inliers = refitted
        return inliers if len(inliers) >= self.parameters.min_inliers else None

    def _stretch(self, points: np.ndarray, line: np.ndarray) -> np.ndarray:
        near = np.flatnonzero(np.abs(points @ line[:2] - line[2]) <= self.parameters.distance)
        along = points[near] @ np.array([-line[1], line[0]])
        order = np.argsort(along)
        runs = np.split(near[order], np.flatnonzero(np.diff(along[order]) > self.parameters.max_gap) + 1)
        return np.sort(max(runs, key=len))

    def _line(self, echoes: BeamEchoes, inliers: np.ndarray) -> Optional[Line]:
        points = echoes.points[inliers]
        line = fitted_line(points, echoes.weights[inliers])
        distances = points @ line[:2] - line[2]
        direction = np.array([-line[1], line[0]])
        along = points @ direction
        ends = line[2] * line[:2] + np.outer([along.min(), along.max()], direction)
        coverage = np.count_nonzero(np.histogram(along, bins=_PARTS)[0]) / _PARTS
        if along.max() - along.min() < self.parameters.min_length or coverage < self.parameters.min_coverage:
            return None
        members = echoes.members[np.isin(echoes.owner, inliers)]
        return Line(line[:2], float(line[2]), ends, members, len(inliers), float(np.sqrt(np.mean(distances**2))))


def fitted_line(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return (normal x, normal y, offset >= 0) of the line with the least squared distances from points (n, 2).

    weights: (n,), positive; an echo of many bins tells its place better than one of few.
    """
    center = weights @ points / weights.sum()
    spread = points - center
    normal = np.linalg.eigh((weights * spread.T) @ spread)[1][:, 0]
    offset = normal @ center
    return np.append(normal, offset) * (1.0 if offset >= 0.0 else -1.0)
