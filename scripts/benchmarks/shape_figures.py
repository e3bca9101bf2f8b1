"""Walls and buoys found in simulated scans of the basin, against the world; and the time of the search."""

import math
from dataclasses import dataclass
from functools import reduce
from typing import List, Optional, Sequence

import numpy as np

from benchmarks.harness import Row
from benchmarks.scans import BUOYS, WALLS, BasinScans, anywhere, near_buoy
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.stage_table import Stage
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_processing.shapes.lines import Line, LineDetector, LineDetectorParameters

SEEDS = 100
SPREADS = (0.15, 1.0)
WALL_REACHES = (48.0, 50.0)
BUOY_RADII = ((0.2, 0.6), (0.4, 0.6))
DISTANCE_TOLERANCE, ANGLE_TOLERANCE = 0.15, math.radians(1.0)
_SAME_WALL = 0.95


@dataclass(frozen=True)
class WallErrors:
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


def wall_rows(spread: float, name: str, chain: Sequence[Stage]) -> List[Row]:
    """Measure walls from random places, seed by seed. The sonar reaches 50 m: of a wall there it sees a few metres."""
    scans, detector = BasinScans(spread), LineDetector(LineDetectorParameters())
    clouds = [
        reduce(lambda cloud, stage: stage(cloud), chain, scans.scan(anywhere(seed), seed)) for seed in range(SEEDS)
    ]
    lines = [detector(cloud) for cloud in clouds]
    result = []
    for farthest in WALL_REACHES:
        seeds = [wall_errors(lines[seed], anywhere(seed), farthest) for seed in range(SEEDS)]
        result += _wall_rows(f"{name}, spread {spread} m, walls within {farthest:.0f} m", seeds)
    return result


def _wall_rows(name: str, seeds: List[List[WallErrors]]) -> List[Row]:
    good = sum(all(error.is_good for error in errors) for errors in seeds)
    found = [error for errors in seeds for error in errors if error.distance is not None]
    worst = f"{max(e.distance for e in found):.2f} m, {math.degrees(max(e.angle for e in found)):.2f} deg"
    return [
        (f"{name}: all found to 0.15 m, 1 deg", f"{good} of {SEEDS} seeds", ">= 99"),
        (f"{name}: found of those there", f"{len(found)} of {sum(map(len, seeds))}", ""),
        (f"{name}: greatest errors of those found", worst, "0.15 m, 1 deg"),
    ]


def buoy_rows(spread: float, min_radius: float, max_radius: float) -> List[Row]:
    """Measure a buoy of 0.5 m radius from 10 m, seed by seed, told that its radius lies between two values [m]."""
    scans = BasinScans(spread)
    detector = CircleDetector(CircleDetectorParameters(min_radius=min_radius, max_radius=max_radius))
    thresholder = Thresholder(ThresholderParameters())
    errors = []
    for seed in range(SEEDS):
        pose, buoy = near_buoy(seed), np.array(BUOYS[seed % len(BUOYS)])
        cloud = thresholder(scans.scan(pose, seed))
        circles = detector(cloud, lambda times, place=pose[:2, 3]: np.tile(place, (len(times), 1)))
        errors.append(min((float(np.linalg.norm(circle.center - buoy)) for circle in circles), default=math.inf))
    good = sum(error <= DISTANCE_TOLERANCE for error in errors)
    name = f"thresholded, spread {spread} m: buoy of 0.5 m at 10 m, radius {min_radius} to {max_radius} m"
    return [
        (f"{name}, error of its centre", f"{np.median(errors):.2f} m median", "0.15 m"),
        (f"{name}, within 0.15 m", f"{good} of {SEEDS} seeds", ">= 99"),
    ]


def rows() -> List[Row]:
    """Return the figures of the shapes."""
    found = []
    for spread in SPREADS:
        cleaned = [Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())]
        extractor = EchoExtractor(EchoExtractorParameters(pulse_sigma=spread))
        found += wall_rows(spread, "cleaned", cleaned) + wall_rows(spread, "echoes", [extractor])
        found += [row for radii in BUOY_RADII for row in buoy_rows(spread, *radii)]
    return found
