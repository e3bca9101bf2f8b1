"""Open3D's outlier removal decides each point as scipy's path does, or leaves the cloud to it."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from node_support.open3d_library import open3d_or_none
from sonar_processing.filters.open3d_outliers import FEWEST_POINTS, open3d_statistical_inliers
from sonar_processing.filters.outliers import scipy_statistical_inliers, statistical_inliers

COUNT = FEWEST_POINTS + 500
SEEDS = st.integers(0, 2**32 - 1)
NEIGHBORS = st.sampled_from([1, 2, 5, 20, 60])
MULTIPLIERS = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 3.0))


def _blob(rng):
    return rng.normal(0.0, 5.0, (COUNT, 3))


def _level_scan(rng):
    angles, ranges = rng.randint(0, 180, COUNT) * np.pi / 90.0, rng.uniform(1.0, 50.0, COUNT)
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(COUNT)])


def _lattice(rng):
    return rng.randint(-12, 13, (COUNT, 3)) * 0.1


def _blob_with_copies(rng):
    points = _blob(rng)
    points[rng.randint(0, COUNT, 200)] = points[0]
    return points


CLOUDS = {"blob": _blob, "level": _level_scan, "lattice": _lattice, "copies": _blob_with_copies}


@pytest.mark.parametrize("kind", CLOUDS)
@settings(max_examples=15)
@given(SEEDS, NEIGHBORS, MULTIPLIERS)
def test_every_point_is_decided_as_without_open3d(kind, seed, mean_k, multiplier):
    points = CLOUDS[kind](np.random.RandomState(seed)).astype(np.float32)
    expected = scipy_statistical_inliers(points, mean_k, multiplier)
    np.testing.assert_array_equal(statistical_inliers(points, mean_k, multiplier), expected)


@pytest.mark.parametrize("kind", ["blob", "level"])
def test_open3d_decides_for_scans(kind):
    pytest.importorskip("open3d")
    points = CLOUDS[kind](np.random.RandomState(0)).astype(np.float32)
    assert open3d_statistical_inliers(points, 20, 1.0) is not None


def test_points_that_all_stand_alike_are_left_to_scipy():
    x, y = np.divmod(np.arange(80 * 80), 80)
    points = np.column_stack([x, y, np.zeros(6400)]).astype(np.float32)
    assert open3d_statistical_inliers(points, 20, 1.0) is None


def test_many_copies_of_one_point_are_left_to_scipy():
    points = np.concatenate([_blob(np.random.RandomState(0)), np.ones((50, 3))]).astype(np.float32)
    assert open3d_statistical_inliers(points, 20, 1.0) is None
    assert statistical_inliers(points, 20, 1.0)[-50:].all()


def test_without_open3d_one_line_says_what_to_install(monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, "open3d", None)
    open3d_or_none.cache_clear()
    points = _blob(np.random.RandomState(0)).astype(np.float32)
    for _ in range(3):
        np.testing.assert_array_equal(statistical_inliers(points, 20, 1.0), scipy_statistical_inliers(points, 20, 1.0))
    open3d_or_none.cache_clear()
    assert [record.getMessage().count("apt install python3-open3d") for record in caplog.records] == [1]
