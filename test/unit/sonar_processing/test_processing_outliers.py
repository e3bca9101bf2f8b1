"""Outlier removal against the rules of the Point Cloud Library, worked out point by point."""

import math
from fractions import Fraction

import numpy as np
import pytest
from clouds import cloud_of
from hypothesis import assume, example, given
from hypothesis import strategies as st

from sonar_processing.cloud import Cloud
from sonar_processing.filters.outliers import (
    OutlierRemover,
    OutlierRemoverParameters,
    radius_inliers,
    statistical_inliers,
)

FLOATS = st.floats(-4.0, 4.0, width=32)
RANDOM = st.lists(st.tuples(FLOATS, FLOATS, FLOATS), max_size=25)
LATTICE = st.lists(st.tuples(*[st.integers(-2, 2)] * 3), max_size=25)


def _array(points, scale=1.0):
    return (np.array(points, dtype=np.float64).reshape(-1, 3) * scale).astype(np.float32)


def _pcl_statistical(points, mean_k):
    """Return each point's mean distance to its nearest others, as pcl::StatisticalOutlierRemoval takes them."""
    points = points.astype(np.float64)
    means = []
    for index, point in enumerate(points):
        others = np.delete(points, index, axis=0)
        distances = sorted(math.sqrt(((point - other) ** 2).sum()) for other in others)
        nearest = distances[:mean_k]
        means.append(math.fsum(nearest) / len(nearest))
    return means


def _pcl_radius(points, radius, min_neighbors):
    """Return whether more than so many points, itself included, lie within the radius of each, in float32.

    As PCL 1.8 and later decide dense clouds: float32 squared distances against the squared radius as a double.
    """
    keep = []
    for point in points:
        x, y, z = (point - points).T
        squared = ((x * x + y * y) + z * z).astype(np.float64)
        keep.append(np.count_nonzero(squared <= radius * radius) > min_neighbors)
    return keep


@pytest.mark.parametrize("strategy", [RANDOM, LATTICE], ids=["anywhere", "on a lattice, with duplicates"])
@given(st.data(), st.integers(1, 30), st.floats(0.0, 3.0))
def test_statistical_keeps_what_pcl_keeps(strategy, data, mean_k, multiplier):
    points = _array(data.draw(strategy.filter(lambda points: len(points) >= 3)))
    means = [Fraction(mean) for mean in _pcl_statistical(points, mean_k)]
    mean = sum(means) / len(means)
    variance = sum((value - mean) ** 2 for value in means) / (len(means) - 1)
    limit = float(mean) + multiplier * math.sqrt(variance)
    assume(all(abs(float(value) - limit) > 1e-9 for value in means))
    assert statistical_inliers(points, mean_k, multiplier).tolist() == [float(value) <= limit for value in means]


@pytest.mark.parametrize(("multiplier", "is_kept"), [(1.6, True), (1.5, True), (1.4, False)])
def test_statistical_takes_the_samples_standard_deviation_and_keeps_a_point_on_the_limit(multiplier, is_kept):
    # Mean distances 1, 1, 4 and 1: mean 1.75, sd 1.5 of the sample and 1.3 of the population.
    points = _array([(0, 0, 0), (1, 0, 0), (5, 0, 0), (0, 1, 0)])
    assert statistical_inliers(points, 1, multiplier).tolist() == [True, True, is_kept, True]


@pytest.mark.parametrize("count", range(3, 40))
@pytest.mark.parametrize("multiplier", [0.0, 0.1, 1.0])
def test_statistical_keeps_all_points_that_stand_alike(count, multiplier):
    square = np.array([(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.3, 0.3, 0.0)])
    points = np.tile(square, (count, 1)).astype(np.float32)
    points[:, 2] = np.repeat(64.0 * np.arange(count), 4)
    assert statistical_inliers(points, 3, multiplier).all()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_statistical_finds_no_outlier_among_fewer_than_three_points(count):
    assert statistical_inliers(_array([(0, 0, 0), (9, 0, 0)][:count]), 20, 0.0).tolist() == [True] * count


@given(RANDOM, st.floats(0.01, 8.0), st.integers(1, 10))
def test_radius_keeps_what_pcl_keeps(points, radius, min_neighbors):
    points = _array(points)
    assert radius_inliers(points, radius, min_neighbors).tolist() == _pcl_radius(points, radius, min_neighbors)


@pytest.mark.parametrize("spacing", [1.0, 0.1, 0.3, 1.0 / 3.0, 7.7])
@given(LATTICE, st.sampled_from([1.0, 2.0, math.sqrt(2.0), math.sqrt(3.0), math.sqrt(5.0)]), st.integers(1, 8))
@example([(0, 0, 0), (1, 0, 0)], 1.0, 1)
def test_radius_on_lattices_with_points_exactly_on_the_border(spacing, points, steps, min_neighbors):
    points, radius = _array(points, spacing), spacing * steps
    assert radius_inliers(points, radius, min_neighbors).tolist() == _pcl_radius(points, radius, min_neighbors)


def test_a_stray_echo_goes_and_its_stamp_with_it():
    cloud = _cluster_and_a_stray()
    for mode in ("STATISTICAL", "RADIUS"):
        kept = OutlierRemover(OutlierRemoverParameters(mode=mode, min_neighbors=3))(cloud)
        assert kept.time_stamps.tolist() == cloud.time_stamps[:-1].tolist()
        np.testing.assert_array_equal(kept.points, cloud.points[:-1])


def test_none_passes_the_cloud_through():
    cloud = _cluster_and_a_stray()
    assert OutlierRemover(OutlierRemoverParameters(mode="NONE"))(cloud) is cloud


@pytest.mark.parametrize("mode", ["STATISTICAL", "RADIUS"])
def test_points_that_are_not_finite_go_and_do_not_count_as_neighbours(mode):
    cloud = _cluster_and_a_stray()
    broken = cloud.points.copy()
    broken[:3, 1] = np.nan
    finite = Cloud(cloud.points[3:], cloud.time_stamps[3:], 0, "odom")
    remove = OutlierRemover(OutlierRemoverParameters(mode=mode, min_neighbors=3))
    kept = remove(Cloud(broken, cloud.time_stamps, 0, "odom"))
    assert kept.time_stamps.tolist() == remove(finite).time_stamps.tolist()
    assert len(kept) == 17


@pytest.mark.parametrize("mode", ["STATISTICAL", "RADIUS"])
@pytest.mark.parametrize("strengths", [[], [np.nan] * 5])
def test_a_cloud_without_a_finite_point_comes_back_empty(mode, strengths):
    assert len(OutlierRemover(OutlierRemoverParameters(mode=mode))(cloud_of(strengths))) == 0


@pytest.mark.parametrize("mode", ["STATISTICAL", "RADIUS"])
def test_an_organised_cloud_keeps_its_shape(mode):
    flat = _cluster_and_a_stray()
    cloud = Cloud(flat.points, flat.time_stamps, 0, "odom", height=3)
    kept = OutlierRemover(OutlierRemoverParameters(mode=mode, min_neighbors=3))(cloud)
    assert (len(kept), kept.height) == (21, 3)
    assert np.flatnonzero(np.isnan(kept.points).all(axis=1)).tolist() == [20]


def _cluster_and_a_stray():
    points = np.zeros((21, 4), dtype=np.float32)
    points[:20, 0], points[:20, 1] = np.divmod(np.arange(20), 5)
    points[:20, :2] *= 0.1
    points[20] = (30.0, 0.0, 0.0, 99.0)
    return Cloud(points, np.arange(21.0), 0, "odom")
