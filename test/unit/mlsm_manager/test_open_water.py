"""Water in which only noise and bubbles are heard leads to no fix; a part of `benchmarks.open_water`."""

import pytest
from benchmarks.open_water import bubbles, outcome

from mlsm_manager.localisation.parameters import EstimatorName

pytestmark = pytest.mark.long

SCANS = 50


@pytest.mark.newest_only("a statistic of many scans; test_map_bag and test_localiser compute single ones")
@pytest.mark.parametrize("estimator", EstimatorName)
def test_noise_and_bubbles_correct_nothing(estimator):
    found = outcome(bubbles, estimator, SCANS, seed=2)
    assert (found.scans, found.fixes) == (SCANS, 0)
    assert found.farthest < 1e-6
