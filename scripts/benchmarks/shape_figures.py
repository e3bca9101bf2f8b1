"""Walls and buoys found in simulated scans of the basin, against the world; and the time of the search."""

import math
from functools import reduce
from typing import Callable, Iterator, List, Sequence, Tuple

import numpy as np

from benchmarks.harness import Row, median_seconds
from benchmarks.scans import basin_cloud
from node_support.geometry import pose_matrix
from sonar_processing.cloud import Cloud
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_processing.shapes.lines import Line, LineDetector, LineDetectorParameters

WALLS = ((1.0, 0.0, 60.0), (-1.0, 0.0, 60.0), (0.0, 1.0, 25.0), (0.0, -1.0, 25.0))
"""Normals x y of the basin's walls, from the middle, and their distances from it, m."""
BUOYS = ((42.0, 17.0), (-50.0, -16.0))
"""Their axes, x y [m]."""
_DEPTH = -1.8  # m
_SEEDS = 100
_SPREADS = (0.15, 1.0)  # m
_REACHES = (48.0, 50.0)  # m
_RADII = ((0.4, 0.6), (0.2, 0.6))  # m
_MOST_DISTANCE, _MOST_ANGLE = 0.15, math.radians(1.0)
_SAME_WALL, _NEAR = 0.95, 3.0  # cosine and m, within which a line is an attempt at a wall

_Errors = Tuple[float, float]
"""Of a line, as far as the wall is: m and rad; infinite where none was found."""


def anywhere(seed: int) -> np.ndarray:
    """Return the (4, 4) pose of a sonar somewhere in the basin, 7 m or more from its walls."""
    rng = np.random.default_rng([1, seed])
    return pose_matrix((rng.uniform(-50, 50), rng.uniform(-18, 18), _DEPTH), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))


def near_buoy(seed: int) -> np.ndarray:
    """Return the (4, 4) pose of a sonar 10 m from the axis of buoy number seed mod 2, any way round."""
    rng = np.random.default_rng([2, seed])
    x, y = np.full(2, np.inf)
    while abs(x) >= WALLS[0][2] - 3.0 or abs(y) >= WALLS[2][2] - 3.0:
        bearing = rng.uniform(-math.pi, math.pi)
        x, y = BUOYS[seed % len(BUOYS)] + 10.0 * np.array([math.cos(bearing), math.sin(bearing)])
    return pose_matrix((x, y, _DEPTH), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))


def wall_errors(lines: List[Line], T_world_sonar: np.ndarray, farthest: float) -> List[_Errors]:
    """Return the errors of the lines nearest to each of the basin's walls within `farthest` metres of the sonar."""
    sonar, result = T_world_sonar[:2, 3], []
    for *direction, offset in WALLS:
        normal = np.array(direction)
        reach = offset - normal @ sonar
        foot = sonar + reach * normal
        alike = [(line.distance_from(foot), abs(float(line.normal @ normal))) for line in lines]
        distance, cosine = min(
            (one for one in alike if one[1] > _SAME_WALL and one[0] < _NEAR), default=(math.inf, 0.0)
        )
        if reach <= farthest:
            result.append((distance, math.acos(min(cosine, 1.0)) if cosine else math.inf))
    return result


def are_good(errors: Sequence[_Errors]) -> bool:
    """Return whether all walls were found to 0.15 m and 1 deg."""
    return all(distance <= _MOST_DISTANCE and angle <= _MOST_ANGLE for distance, angle in errors)


def buoy_error(spread: float, seed: int, detector: CircleDetector) -> float:
    """Return how far the circle that is nearest to a buoy is from it, m; inf without a circle."""
    pose = near_buoy(seed)
    cloud = Thresholder(ThresholderParameters())(basin_cloud(spread, pose, seed))
    circles = detector(cloud, lambda times: np.tile(pose[:2, 3], (len(times), 1)))
    offsets = (circle.center - BUOYS[seed % len(BUOYS)] for circle in circles)
    return min((float(np.linalg.norm(offset)) for offset in offsets), default=math.inf)


def rows() -> Iterator[Row]:
    """Yield the figures of the shapes."""
    cleaning = Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())
    for spread in _SPREADS:
        scans = [basin_cloud(spread, anywhere(seed), seed) for seed in range(_SEEDS)]
        yield from _wall_rows(f"spread {spread:g} m, cleaned", scans, cleaning)
        extractor = EchoExtractor(EchoExtractorParameters(pulse_sigma=spread))
        yield from _wall_rows(f"spread {spread:g} m, echoes", scans, [extractor])
        for least, most in _RADII:
            detector = CircleDetector(CircleDetectorParameters(min_radius=least, max_radius=most))
            errors = np.array([buoy_error(spread, seed, detector) for seed in range(_SEEDS)])
            name = f"spread {spread:g} m: buoy of 0.5 m at 10 m, radius {least:g} to {most:g} m"
            yield f"{name}, within 0.15 m", f"{(errors <= _MOST_DISTANCE).sum()} of {_SEEDS}", "99"
            yield f"{name}, median error of its centre", f"{np.median(errors):.2f} m", "0.15 m"
    detector = LineDetector(LineDetectorParameters(n_walls=3, probability=1.0, max_iterations=5000))
    cloud = _three_lines(2000, np.random.default_rng(4))
    seconds = median_seconds(lambda: detector(cloud), repeats=30)
    yield "3 lines in 2,000 points, 5,000 hypotheses each", f"{1e3 * seconds:.1f} ms", "20 ms"


def _wall_rows(name: str, scans: Sequence[Cloud], chain: Sequence[Callable[[Cloud], Cloud]]) -> Iterator[Row]:
    detector = LineDetector(LineDetectorParameters())
    lines = [detector(reduce(lambda cloud, stage: stage(cloud), chain, scan)) for scan in scans]
    for reach in _REACHES:
        errors = [wall_errors(each, anywhere(seed), reach) for seed, each in enumerate(lines)]
        good = sum(map(are_good, errors))
        yield f"{name}: all walls within {reach:g} m to 0.15 m and 1 deg", f"{good} of {_SEEDS}", "99"
        if reach == _REACHES[0]:
            distances, angles = np.array([one for each in errors for one in each if math.isfinite(one[0])]).T
            worst = f"{distances.max():.2f} m, {math.degrees(angles.max()):.2f} deg"
            yield f"{name}: greatest errors within {reach:g} m", worst, "0.15 m, 1 deg"


def _three_lines(points: int, rng: np.random.Generator) -> Cloud:
    """Return three noisy lines and a third as many stray points, each point an echo of its own."""
    along, noise, each = rng.uniform(-30.0, 30.0, points), rng.normal(0.0, 0.1, points), np.arange(points) % 4
    x = np.choose(each, [along, 40.0 + noise, along, rng.uniform(-40.0, 40.0, points)])
    y = np.choose(each, [25.0 + noise, along, noise - 25.0, rng.uniform(-40.0, 40.0, points)])
    cloud = np.column_stack([x, y, np.zeros(points), np.full(points, 100.0)]).astype(np.float32)
    return Cloud(cloud, np.arange(1.0, points + 1.0), 10**9, "odom")
