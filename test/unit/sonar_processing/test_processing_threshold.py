"""What the thresholder keeps, by Otsu as the thesis computes it (6.5.3), and when a filter removes everything."""

from fractions import Fraction

import numpy as np
import pytest
from clouds import cloud_of
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from sonar_processing.cloud import Cloud
from sonar_processing.filters.stage_table import EmptiedScans
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters, ThresholdMode, otsu_threshold

LEVELS = st.lists(st.integers(0, 255), min_size=1, max_size=60)
FEW_LEVELS = st.lists(st.sampled_from([0, 1, 2, 100, 101, 200, 255]), min_size=1, max_size=60)
STRENGTHS = st.lists(st.integers(0, 255), max_size=40)
ANY_STRENGTHS = st.lists(
    st.one_of(st.integers(-2, 300), st.floats(-2.0, 300.0, width=32), st.sampled_from([np.nan, np.inf, -np.inf])),
    max_size=60,
)


def literal_threshold(levels):
    """Return the threshold by stepping through all levels; the only level when there is nothing to separate."""
    histogram = [levels.count(level) for level in range(256)]
    total = len(levels)
    first = last = greatest = None
    for t in range(256):
        n1, n2 = sum(histogram[: t + 1]), sum(histogram[t + 1 :])
        if not n1 or not n2:
            continue
        mu1 = Fraction(sum(level * histogram[level] for level in range(t + 1)), n1)
        mu2 = Fraction(sum(level * histogram[level] for level in range(t + 1, 256)), n2)
        between = Fraction(n1, total) * Fraction(n2, total) * (mu1 - mu2) ** 2
        if greatest is None or between > greatest:
            first, greatest = t, between
        if between >= greatest:
            last = t
    return float(levels[0]) if greatest is None else (first + last) / 2.0


@pytest.mark.parametrize("strategy", [LEVELS, FEW_LEVELS], ids=["many levels", "few levels"])
@given(st.data())
def test_it_is_the_mean_of_the_first_and_the_last_maximum(strategy, data):
    levels = data.draw(strategy)
    assert otsu_threshold(np.array(levels)) == literal_threshold(levels)


@pytest.mark.parametrize(("strengths", "levels"), [([-50.0, 1000.0], [0, 255]), ([10.9, 20.2], [10, 20])])
def test_strengths_outside_the_levels_count_in_the_nearest_and_fractions_in_the_level_below(strengths, levels):
    assert otsu_threshold(np.array(strengths)) == literal_threshold(levels)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.float64, np.int64])
def test_the_type_of_the_strengths_does_not_matter(dtype):
    assert otsu_threshold(np.array([3, 4, 90, 95], dtype=dtype)) == literal_threshold([3, 4, 90, 95])


def test_a_large_scan_does_not_overflow():
    levels = np.concatenate([np.full(3_000_000, 250), np.full(2_000_000, 255)])
    assert otsu_threshold(levels) == literal_threshold([250, 250, 250, 255, 255])


def test_no_strengths_are_refused():
    with pytest.raises(RefusedInput) as refused:
        otsu_threshold(np.empty(0))
    assert refused.value.kind == "clouds without points"


def _threshold(strengths, **values):
    thresholder = Thresholder(ThresholderParameters(**values))
    thresholder(cloud_of(strengths))
    return thresholder.newest_threshold


def _threshold_by_numpy(strengths, mode, nonzero):
    """Return the threshold of finite strengths (n,), n > 0."""
    echoes, own = strengths[strengths > 0], ThresholderParameters()
    differ = len(np.unique(echoes)) > 1
    otsu = otsu_threshold(echoes if nonzero else np.maximum(strengths, 0)) if differ else 0.0
    proportional = own.max_proportion * float(strengths.max()) + own.min_proportion * float(strengths.min())
    values = {"FIXED": own.fixed_threshold, "PROPORTIONAL": proportional, "OTSU": otsu}
    return max(values.get(mode.value, own.otsu_multiplier * otsu), own.min_threshold)


@pytest.mark.parametrize(
    ("mode", "values", "threshold"),
    [
        ("PROPORTIONAL", {"max_proportion": 0.5, "min_proportion": 0.2}, 49.5),
        ("OTSU", {"otsu_multiplier": 3.0}, 54.5),
        ("OTSU+PROPORTIONAL", {"otsu_multiplier": 1.5}, 81.75),
    ],
)
def test_each_mode_weighs_by_its_own_parameters(mode, values, threshold):
    assert _threshold([10, 20, 90, 95], mode=mode, **values) == pytest.approx(threshold)


@pytest.mark.parametrize("mode", [mode.value for mode in ThresholdMode])
def test_no_mode_goes_below_the_floor_which_lowers_no_threshold(mode):
    assert _threshold([1, 2, 3], mode=mode, fixed_threshold=0.5, min_threshold=40) == 40
    values = {"mode": mode, "fixed_threshold": 120.0}
    assert _threshold([90, 90, 250], min_threshold=10, **values) == _threshold([90, 90, 250], **values) > 10


@given(ANY_STRENGTHS, st.sampled_from(list(ThresholdMode)), st.booleans(), st.sampled_from([1, 2]))
def test_the_finite_points_above_the_threshold_are_kept(strengths, mode, nonzero, height):
    cloud = cloud_of(strengths * height, height=height)
    finite = cloud.points[np.isfinite(cloud.points[:, 3]), 3]
    thresholder = Thresholder(ThresholderParameters(mode=mode, otsu_nonzero=nonzero))
    kept = thresholder(cloud)
    expected = _threshold_by_numpy(finite, mode, nonzero) if len(finite) else None
    assert thresholder.newest_threshold == expected
    assert kept.points[kept.valid, 3].tolist() == [value for value in finite if value > np.float32(expected)]


@pytest.mark.parametrize("column", range(5))
@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_a_point_that_is_not_finite_in_any_value_counts_nowhere(column, broken):
    cloud = cloud_of([10.0, 20.0, 250.0, 90.0, 95.0])
    [*cloud.points.T, cloud.time_stamps][column][2] = broken
    thresholder = Thresholder(ThresholderParameters(mode="PROPORTIONAL"))
    assert thresholder(cloud).points[:, 3].tolist() == [90.0, 95.0]
    assert thresholder.newest_threshold == 0.5 * 95.0 + 0.5 * 10.0


def test_clouds_of_messages_which_cannot_be_written_are_taken():
    cloud = cloud_of([10.0, 20.0, 90.0])
    points, stamps = (np.frombuffer(values.tobytes(), values.dtype) for values in (cloud.points, cloud.time_stamps))
    kept = Thresholder(ThresholderParameters())(Cloud(points.reshape(-1, 4), stamps, 0, "odom"))
    assert kept.points[:, 3].tolist() == [90.0]


@given(STRENGTHS)
def test_stamps_go_with_their_points_and_the_header_stays(strengths):
    kept = Thresholder(ThresholderParameters())(cloud_of(strengths))
    np.testing.assert_array_equal(kept.time_stamps, kept.points[:, 0] + 1.0)
    assert (kept.stamp_ns, kept.frame_id) == (5 * 10**9, "odom")


def test_an_organised_cloud_keeps_its_shape_and_its_stamps_and_the_one_given_is_not_changed():
    cloud = cloud_of([10, 100, 20, 200, 30, 90], height=2)
    before = cloud.points.copy()
    kept = Thresholder(ThresholderParameters(mode="FIXED"))(cloud)
    assert (kept.height, len(kept), kept.organized, kept.points.dtype) == (2, 6, True, np.float32)
    assert np.isnan(kept.points).all(axis=1).tolist() == [True, False, True, False, True, False]
    assert kept.time_stamps.tolist() == cloud.time_stamps.tolist()
    np.testing.assert_array_equal(cloud.points, before)


def test_the_newest_threshold_can_be_read():
    thresholder = Thresholder(ThresholderParameters(mode="FIXED", fixed_threshold=66))
    assert thresholder.newest_threshold is None
    thresholder(cloud_of([1, 2]))
    assert thresholder.newest_threshold == 66
    thresholder(cloud_of([]))
    assert thresholder.newest_threshold is None


@pytest.mark.parametrize("mode", ["OTSU", "OTSU+PROPORTIONAL"])
@pytest.mark.parametrize("nonzero", [True, False])
@pytest.mark.parametrize("strength", [1, 127, 255])
def test_echoes_that_are_all_equally_strong_pass(mode, nonzero, strength):
    kept = Thresholder(ThresholderParameters(mode=mode, otsu_nonzero=nonzero))(cloud_of([0, strength, 0, strength]))
    assert kept.points[:, 3].tolist() == [strength, strength]


@pytest.mark.parametrize(
    ("scans", "noticed"),
    [
        ([(5, 0)] * 35, [10, 20, 30]),
        ([(5, 0)] * 9 + [(5, 1)] + [(5, 0)] * 9, []),
        ([(5, 0)] * 9 + [(0, 0)] * 5 + [(5, 0), (0, 0)], [15]),
    ],
    ids=["none has a point left", "one has, which begins the count anew", "some come without points"],
)
def test_every_tenth_scan_in_a_row_that_loses_all_its_points_is_noticed(scans, noticed):
    emptied = EmptiedScans()
    assert [number for number, counts in enumerate(scans, 1) if emptied.take(*counts)] == noticed
