"""Walls and buoys in simulated scans of the basin are found where they are."""

import pytest
from benchmarks.scans import basin_cloud
from benchmarks.shape_figures import anywhere, are_good, buoy_error, wall_errors

from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_processing.shapes.lines import LineDetector, LineDetectorParameters

_THRESHOLDER = Thresholder(ThresholderParameters())
_REMOVER = OutlierRemover(OutlierRemoverParameters())


@pytest.mark.parametrize("spread", [0.15, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_walls_in_range_are_found_within_15_cm_and_1_degree(seed, spread):
    pose = anywhere(seed)
    lines = LineDetector(LineDetectorParameters())(_REMOVER(_THRESHOLDER(basin_cloud(spread, pose, seed))))
    errors = wall_errors(lines, pose, farthest=48.0)
    assert errors
    assert are_good(errors), (errors, pose)


@pytest.mark.parametrize("seed", range(3))
def test_a_buoy_at_10_m_is_found_within_15_cm(seed):
    assert buoy_error(0.15, seed, CircleDetector(CircleDetectorParameters())) < 0.15
