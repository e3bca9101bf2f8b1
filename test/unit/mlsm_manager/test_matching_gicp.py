"""Open3D's generalised ICP as a matcher."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import harbour, map_of, prior_of_pose, scan_of, still

from mlsm_manager.matching.matchers.matcher_table import MATCHERS, MatcherName
from mlsm_manager.matching.matchers.parameters import GicpMatcherParameters
from mlsm_manager.scan_matching.result import MatchStatus, corrected_points
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import composed
from node_support.parameters import ParameterError


def match(scan, target, expected, **changes):
    pytest.importorskip("open3d")
    matcher = MATCHERS[MatcherName.GICP].build(GicpMatcherParameters().changed(changes))
    return matcher.match(scan, target, prior_of_pose(scan, expected))


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


def test_the_points_come_to_lie_on_the_map():
    scan = scan_of(harbour(), still())
    result = match(scan, map_of(harbour()), [0.5, -0.3, 0.04])
    places = scan_of(harbour(), still()).points[:, :2]
    assert np.abs(corrected_points(scan, result)[:, :2] - places).max() < 0.3


def test_the_covariance_is_that_of_a_pose_and_shrinks_with_the_points():
    many, few = harbour(), harbour()[::4]
    first, second = (match(scan_of(places, still()), map_of(many), [0.3, 0.2, 0.0]) for places in (few, many))
    for result in (first, second):
        assert (np.linalg.eigvalsh(result.covariance[:3, :3]) > 0.0).all()
    assert np.trace(second.covariance[:2, :2]) < np.trace(first.covariance[:2, :2])


def test_a_map_that_grows_is_matched_like_a_copy_of_its_blocks():
    growing = MultiLevelSurfaceMap(0.5)
    growing.insert(scan_of(harbour(), still()).points)
    scan = scan_of(harbour(), still())
    ours, wanted = (match(scan, target, [0.5, -0.3, 0.04]) for target in (growing, growing.blocks))
    np.testing.assert_allclose(ours.pose, wanted.pose, rtol=0.0, atol=1e-9)


def test_too_few_points_leave_the_prior():
    result = match(scan_of(harbour()[:5], still()), map_of(harbour()), [0.3, 0.2, 0.0])
    assert result.status is MatchStatus.TOO_FEW_POINTS
    np.testing.assert_allclose(result.pose, [0.3, 0.2, 0.0], atol=1e-9)


def test_a_map_out_of_reach_is_not_matched():
    result = match(scan_of(harbour(), still()), map_of(harbour() + 400.0), np.zeros(3))
    assert result.status is MatchStatus.TOO_FEW_POINTS
    assert "0 points on the map" in result.reason


def test_without_open3d_it_is_refused_with_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(ParameterError, match="apt install python3-open3d"):
        MATCHERS[MatcherName.GICP].build(GicpMatcherParameters())
