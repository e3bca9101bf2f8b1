"""The compiled loops of thresholder and outlier remover keep the points that numpy and scipy keep."""

import numpy as np
import pytest
from clouds import cloud_of
from hypothesis import assume, given
from hypothesis import strategies as st

from node_support.kernels import Kernel
from node_support.parameters import ParameterError
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters, outlier_rules
from sonar_processing.filters.strengths import strength_loops
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters, ThresholdMode

pytest.importorskip("numba")
STRENGTHS = st.lists(
    st.one_of(st.integers(-2, 300), st.floats(-2.0, 300.0, width=32), st.sampled_from([np.nan, np.inf, -np.inf])),
    max_size=60,
)
COORDINATES = st.floats(-4.0, 4.0, width=32)
POINTS = st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), min_size=3, max_size=60)


def _thresholders(**values):
    return [Thresholder(ThresholderParameters(kernel=kernel, **values)) for kernel in Kernel]


def _array(points):
    return np.array(points, dtype=np.float32).reshape(-1, 3)


def _scan(points):
    """Return (n, 3) float32: three fifths of the points on a round wall, so that the tree is deep and uneven."""
    rng = np.random.RandomState(3)
    angles = 2.0 * np.pi * rng.randint(0, 120, points) / 120
    ranges = np.where(rng.uniform(size=points) < 0.6, rng.normal(20.0, 0.5, points), rng.uniform(1.0, 50.0, points))
    heights = rng.normal(-2.0, 0.05, points)
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), heights]).astype(np.float32)


@given(STRENGTHS, st.sampled_from(list(ThresholdMode)), st.booleans(), st.sampled_from([1, 2]))
def test_the_threshold_and_what_it_keeps_are_the_same(strengths, mode, nonzero, height):
    cloud = cloud_of(strengths * height, height=height)
    by_numpy, by_numba = _thresholders(mode=mode, otsu_nonzero=nonzero)
    expected, kept = by_numpy(cloud), by_numba(cloud)
    assert by_numba.newest_threshold == by_numpy.newest_threshold
    np.testing.assert_array_equal(kept.points, expected.points)
    np.testing.assert_array_equal(kept.time_stamps, expected.time_stamps)


@pytest.mark.parametrize("column", range(5))
@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_a_point_that_is_not_finite_in_any_value_counts_nowhere(column, broken):
    cloud = cloud_of([10.0, 20.0, 250.0, 90.0, 95.0])
    values = [*cloud.points.T, cloud.time_stamps]
    values[column][2] = broken
    counts = [strength_loops(kernel).count(cloud) for kernel in Kernel]
    assert [count.highest for count in counts] == [95.0, 95.0]
    assert [strength_loops(kernel).strong(cloud, 50.0).tolist() for kernel in Kernel] == [[3, 4], [3, 4]]


def test_clouds_of_messages_which_cannot_be_written_are_taken():
    cloud = cloud_of([10.0, 20.0, 90.0])
    points, stamps = (np.frombuffer(values.tobytes(), values.dtype) for values in (cloud.points, cloud.time_stamps))
    read_only = IntensityCloud(points.reshape(-1, 4), stamps, 0, "odom")
    by_numpy, by_numba = _thresholders()
    np.testing.assert_array_equal(by_numba(read_only).points, by_numpy(cloud).points)


@given(POINTS, st.integers(1, 30), st.floats(0.0, 3.0))
def test_statistical_keeps_the_same_points(points, mean_k, multiplier):
    points = _array(points)
    others = np.linalg.norm(points[:, np.newaxis].astype(float) - points, axis=2)
    means = np.sort(others, axis=1)[:, 1 : mean_k + 1].mean(axis=1)
    assume((abs(means - means.mean() - multiplier * means.std(ddof=1)) > 1e-9).all())
    by_scipy, by_numba = (outlier_rules(kernel).statistical(points, mean_k, multiplier) for kernel in Kernel)
    np.testing.assert_array_equal(by_numba, by_scipy)


@given(POINTS, st.floats(0.01, 8.0), st.integers(1, 10))
def test_radius_keeps_the_same_points(points, radius, min_neighbors):
    by_scipy, by_numba = (outlier_rules(kernel).radius(_array(points), radius, min_neighbors) for kernel in Kernel)
    np.testing.assert_array_equal(by_numba, by_scipy)


@pytest.mark.parametrize("spacing", [1.0, 0.1, 1.0 / 3.0])
def test_radius_decides_points_on_its_border_in_the_same_way(spacing):
    lattice = (np.mgrid[0:5, 0:5, 0:2].reshape(3, -1).T * spacing).astype(np.float32)
    by_scipy, by_numba = (outlier_rules(kernel).radius(lattice, 2 * spacing, 12) for kernel in Kernel)
    np.testing.assert_array_equal(by_numba, by_scipy)


@pytest.mark.parametrize("points", [3, 4, 15, 16, 17, 33, 1000, 3000])
def test_scans_of_any_size_lose_the_same_points(points):
    scan = _scan(points)
    by_scipy, by_numba = (outlier_rules(kernel) for kernel in Kernel)
    np.testing.assert_array_equal(by_numba.statistical(scan, 20, 1.0), by_scipy.statistical(scan, 20, 1.0))
    np.testing.assert_array_equal(by_numba.radius(scan, 1.0, 20), by_scipy.radius(scan, 1.0, 20))


@pytest.mark.parametrize("mode", ["STATISTICAL", "RADIUS"])
@pytest.mark.parametrize("points", [0, 1, 2, 50])
def test_points_that_coincide_and_hardly_any_points_are_no_special_case(mode, points):
    cloud = IntensityCloud(np.zeros((points, 4), np.float32), np.ones(points), 0, "odom")
    kept = [len(OutlierRemover(OutlierRemoverParameters(mode=mode, kernel=kernel))(cloud)) for kernel in Kernel]
    assert kept[1] == kept[0]


@pytest.mark.parametrize("parameters", [ThresholderParameters, OutlierRemoverParameters])
def test_compiled_loops_without_numba_are_refused_in_one_line(monkeypatch, parameters):
    monkeypatch.setattr("node_support.kernels.find_spec", lambda name: None)
    with pytest.raises(ParameterError, match="kernel = NUMBA: needs numba; install it with"):
        parameters(kernel="NUMBA")
