"""Walls and buoys found in simulated scans of the basin, against the world."""

import math
from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from benchmarks.harness import Row
from benchmarks.scans import BUOYS, WALLS, BasinScans, anywhere, near_buoy
from sonar_processing.cloud import Cloud
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_processing.shapes.lines import Line, LineDetector, LineDetectorParameters

SEEDS = 100
SPREADS = (0.15, 1.0)
WALL_REACHES = (48.0, 50.0)
BUOY_RADII = ((0.2, 0.6), (0.4, 0.6))
DISTANCE_TOLERANCE, ANGLE_TOLERANCE = 0.15, math.radians(1.0)
_SAME_WALL = 0.95


class WallErrors(NamedTuple):
    """One wall that is there: its distance from the sonar, and the errors of what was found, None when nothing was."""

    reach: float
    distance: Optional[float]
    angle: Optional[float]

    @property
    def is_good(self) -> bool:
        """Whether it was found within the tolerances."""
        found = self.distance is not None and self.angle is not None
        return found and abs(self.distance) <= DISTANCE_TOLERANCE and self.angle <= ANGLE_TOLERANCE


def wall_errors(lines: List[Line], T_world_sonar: np.ndarray, farthest: float) -> List[WallErrors]:
    """Compare lines with the basin's walls within `farthest` metres of the sonar."""
    sonar, result = T_world_sonar[:2, 3], []
    for x, y, offset in WALLS:
        normal = np.array([x, y])
        reach = offset - normal @ sonar
        if reach > farthest:
            continue
        foot = sonar + reach * normal
        near = [line for line in lines if abs(line.normal @ normal) > _SAME_WALL and line.distance_from(foot) < 3.0]
        best = min(near, key=lambda line: line.distance_from(foot), default=None)
        angle = None if best is None else math.acos(min(abs(best.normal @ normal), 1.0))
        result.append(WallErrors(reach, None if best is None else best.distance_from(foot), angle))
    return result


def rows() -> List[Row]:
    """Return the figures of walls from random places and of buoys of 0.5 m radius from 10 m, seed by seed."""
    threshold, found = Thresholder(ThresholderParameters()), []
    for spread in SPREADS:
        scans, remove = BasinScans(spread), OutlierRemover(OutlierRemoverParameters())
        extract = EchoExtractor(EchoExtractorParameters(pulse_sigma=spread))
        turns = [scans.scan(anywhere(seed), seed) for seed in range(SEEDS)]
        found += _wall_rows(f"cleaned, spread {spread} m", [remove(threshold(turn)) for turn in turns])
        found += _wall_rows(f"echoes, spread {spread} m", [extract(turn) for turn in turns])
        clouds = [threshold(scans.scan(near_buoy(seed), seed)) for seed in range(SEEDS)]
        found += [row for radii in BUOY_RADII for row in _buoy_rows(f"thresholded, spread {spread} m", clouds, radii)]
    return found


def _wall_rows(name: str, clouds: List[Cloud]) -> List[Row]:
    """Compare walls; the sonar reaches 50 m: of a wall there it sees a few metres."""
    detector, result = LineDetector(LineDetectorParameters()), []
    lines = [detector(cloud) for cloud in clouds]
    for farthest in WALL_REACHES:
        seeds = [wall_errors(lines[seed], anywhere(seed), farthest) for seed in range(SEEDS)]
        good = sum(all(error.is_good for error in errors) for errors in seeds)
        there = [error for errors in seeds for error in errors if error.distance is not None]
        worst = f"{max(e.distance for e in there):.2f} m, {math.degrees(max(e.angle for e in there)):.2f} deg"
        title = f"{name}, walls within {farthest:.0f} m"
        result += [
            (f"{title}: all found to 0.15 m, 1 deg", f"{good} of {SEEDS} seeds", ">= 99"),
            (f"{title}: greatest errors of those found", worst, "0.15 m, 1 deg"),
        ]
    return result


def _buoy_rows(name: str, clouds: List[Cloud], radii: Tuple[float, float]) -> List[Row]:
    """Compare buoys whose radius is said to lie between two values [m]."""
    detector, errors = CircleDetector(CircleDetectorParameters(min_radius=radii[0], max_radius=radii[1])), []
    for seed, cloud in enumerate(clouds):
        place = near_buoy(seed)[:2, 3]
        circles = detector(cloud, lambda times, place=place: np.tile(place, (len(times), 1)))
        off = [float(np.linalg.norm(circle.center - BUOYS[seed % len(BUOYS)])) for circle in circles]
        errors.append(min(off, default=math.inf))
    title = f"{name}: buoy of 0.5 m at 10 m, radius {radii[0]} to {radii[1]} m"
    good = sum(error <= DISTANCE_TOLERANCE for error in errors)
    return [
        (f"{title}, error of its centre", f"{np.median(errors):.2f} m median", "0.15 m"),
        (f"{title}, within 0.15 m", f"{good} of {SEEDS} seeds", ">= 99"),
    ]
