"""Open3D's generalised ICP, with which the figures of docs/results.md compare."""

import numpy as np
import pytest
from benchmarks.matchers import GicpMatcher
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import harbour, map_of, prior_of_pose, scan_of, still

from mlsm_manager.scan_matching.scan import MatchStatus
from node_support.geometry import composed


def match(scan, target, expected):
    pytest.importorskip("open3d")
    return GicpMatcher().match(scan, target, prior_of_pose(scan, expected))


@settings(max_examples=25)
@given(
    st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(-0.05, 0.05),
    st.tuples(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(-3.0, 3.0)),
)  # fmt: skip
def test_a_pose_is_found_from_a_wrong_expectation_anywhere(x, y, yaw, place):
    to_place = np.array(place)
    here = composed(to_place, np.column_stack([harbour(), np.zeros(len(harbour()))]))[:, :2]
    scan = scan_of(here, still(to_place))
    result = match(scan, map_of(here), composed(to_place, np.array([x, y, yaw])))
    assert result.status is MatchStatus.CONVERGED
    np.testing.assert_allclose(result.pose[:2], to_place[:2], atol=0.15)
    assert np.cos(result.pose[2] - place[2]) > np.cos(0.02)


@pytest.mark.parametrize(("points", "aside"), [(5, 0.0), (None, 400.0)])
def test_too_few_points_or_a_map_out_of_reach_leave_the_prior(points, aside):
    result = match(scan_of(harbour()[:points], still()), map_of(harbour() + aside), [0.3, 0.2, 0.0])
    assert result.status is MatchStatus.TOO_FEW_POINTS
    np.testing.assert_allclose(result.pose, [0.3, 0.2, 0.0], atol=1e-9)
