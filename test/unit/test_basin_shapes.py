"""A few of the seeds that scripts/bench --shapes measures a hundred of."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from benchmarks.scans import BUOYS, BasinScans, anywhere, near_buoy
from benchmarks.shape_figures import wall_errors

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
    lines = LineDetector(LineDetectorParameters())(_REMOVER(_THRESHOLDER(BasinScans(spread).scan(pose, seed))))
    assert all(error.is_good for error in wall_errors(lines, pose, 48.0)), (lines, pose)


@pytest.mark.parametrize("seed", range(3))
def test_a_buoy_at_10_m_is_found_within_15_cm(seed):
    pose = near_buoy(seed)
    detector = CircleDetector(CircleDetectorParameters())
    cloud = _THRESHOLDER(BasinScans(0.15).scan(pose, seed))
    circles = detector(cloud, lambda times: np.tile(pose[:2, 3], (len(times), 1)))
    assert min(np.linalg.norm(circle.center - BUOYS[seed % 2]) for circle in circles) < 0.15
