"""Walls and buoys in simulated scans of the basin are found where they are."""

import math

import numpy as np
import pytest
from benchmarks.scans import BasinScans

from node_support.geometry import pose_matrix
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_processing.shapes.lines import LineDetector, LineDetectorParameters

DEPTH = -1.8
HALF_LENGTH, HALF_WIDTH = 60.0, 25.0
WALLS = ((1.0, 0.0, HALF_LENGTH), (-1.0, 0.0, HALF_LENGTH), (0.0, 1.0, HALF_WIDTH), (0.0, -1.0, HALF_WIDTH))
BUOYS = ((42.0, 17.0), (-50.0, -16.0))
_THRESHOLDER = Thresholder(ThresholderParameters())
_REMOVER = OutlierRemover(OutlierRemoverParameters())


def anywhere(seed):
    """Return the (4, 4) pose of a sonar somewhere in the basin, 7 m or more from its walls."""
    rng = np.random.default_rng([1, seed])
    return pose_matrix((rng.uniform(-50, 50), rng.uniform(-18, 18), DEPTH), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))


def near_buoy(seed, distance=10.0):
    """Return the (4, 4) pose of a sonar `distance` m from the axis of buoy number seed mod 2, any way round."""
    rng = np.random.default_rng([2, seed])
    x, y = np.full(2, np.inf)
    while abs(x) >= HALF_LENGTH - 3.0 or abs(y) >= HALF_WIDTH - 3.0:
        bearing = rng.uniform(-math.pi, math.pi)
        x, y = BUOYS[seed % len(BUOYS)] + distance * np.array([math.cos(bearing), math.sin(bearing)])
    return pose_matrix((x, y, DEPTH), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))


def is_found(normal, reach, sonar, lines):
    """Return whether one of the lines is a wall `reach` m from the sonar to 15 cm and 1 degree."""
    foot = sonar + reach * normal
    return any(
        abs(line.normal @ normal) >= np.cos(np.radians(1.0)) and line.distance_from(foot) <= 0.15 for line in lines
    )


@pytest.mark.parametrize("spread", [0.15, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_walls_in_range_are_found_within_15_cm_and_1_degree(seed, spread):
    pose = anywhere(seed)
    lines = LineDetector(LineDetectorParameters())(_REMOVER(_THRESHOLDER(BasinScans(spread).scan(pose, seed))))
    sonar = pose[:2, 3]
    for x, y, offset in WALLS:
        reach = offset - np.array([x, y]) @ sonar
        assert reach > 48.0 or is_found(np.array([x, y]), reach, sonar, lines), (lines, pose)


@pytest.mark.parametrize("seed", range(3))
def test_a_buoy_at_10_m_is_found_within_15_cm(seed):
    pose = near_buoy(seed)
    detector = CircleDetector(CircleDetectorParameters())
    cloud = _THRESHOLDER(BasinScans(0.15).scan(pose, seed))
    circles = detector(cloud, lambda times: np.tile(pose[:2, 3], (len(times), 1)))
    assert min(np.linalg.norm(circle.center - BUOYS[seed % 2]) for circle in circles) < 0.15
