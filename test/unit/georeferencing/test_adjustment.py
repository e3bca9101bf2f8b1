"""Where fixes of satellites put the map."""

from types import SimpleNamespace

import numpy as np
import pytest

from georeferencing.adjustment import COMPASS_DEVIATION, adjusted, of_compass
from georeferencing.asked import AskedOrigin, LiveOrigin
from georeferencing.fixes import UNKNOWN_DEVIATION, Fix, PlacedFixes, fix_of
from georeferencing.origin import Origin
from node_support.errors import RefusedInput
from node_support.geometry import rotated

pytest.importorskip("pyproj", reason="pyproj is not installed")

TRUTH = Origin(41.2, 3.1, 78.0)
CORRELATION_TIME = 100.0
TWICE = np.append(np.arange(60.0), 1200.0 + np.arange(60.0))
"""Times [s] of a minute of fixes before a dive and of another one after it."""


def path_at(times):
    return np.column_stack([0.3 * times * np.cos(times / 300.0), 0.3 * times * np.sin(times / 200.0)])


def fixes_with(errors, times=TWICE, stated=1.0, moved=0.0):
    """Return fixes that err by `errors` (n, 2) east and north [m], while the path errs by `moved` [m] in the end."""
    places = path_at(times)
    degrees = TRUTH.degrees(places + rotated(errors, np.array(-TRUTH.yaw)))
    fixes = [Fix(time, *place, (stated, stated)) for time, place in zip(times, degrees)]
    return PlacedFixes.of(
        fixes, places + moved * (times > 600.0)[:, np.newaxis], np.where(times > 600.0, moved**2, 0.0)
    )


def lasting(seed, times=TWICE, deviation=1.0):
    """Return errors as a receiver has them: most of one lasts for minutes."""
    apart = np.abs(times[:, np.newaxis] - times)
    covariance = 0.9 * np.exp(-apart / CORRELATION_TIME) + 0.1 * np.eye(len(times))
    return deviation * np.linalg.cholesky(covariance) @ np.random.default_rng(seed).normal(size=(len(times), 2))


def compass(fixes, error_deg=0.0):
    return of_compass(fixes, TRUTH.azimuth_deg + error_deg)


def apart(origin, place):
    """Return how far (2,) [m] east and north an origin puts a place of the map from where it is."""
    found = TRUTH.points(origin.degrees(np.array([place])))[0] - place
    return rotated(found[np.newaxis], np.array(TRUTH.yaw))[0]


def test_exact_fixes_put_the_map_where_it_is():
    fixes = fixes_with(np.zeros((len(TWICE), 2)))
    found = adjusted(fixes, compass(fixes, error_deg=2.0))
    assert found.origin.azimuth_deg == pytest.approx(TRUTH.azimuth_deg, abs=0.2)
    np.testing.assert_allclose(apart(found.origin, [50.0, 50.0]), 0.0, atol=0.3)


@pytest.mark.long
@pytest.mark.parametrize("azimuth_is_known", [True, False])
@pytest.mark.parametrize("walked", [0.0, 3.0])
def test_the_stated_accuracy_is_true_all_along_the_path(azimuth_is_known, walked):
    """Over many receivers, compasses and paths the squared error, in stated variances, is 1 in the mean for each axis.

    walked: by how much the path errs in the end, m; as a random walk does.
    """
    squares, everywhere = [], np.arange(0.0, 1260.0, 30.0)
    times = np.union1d(TWICE, everywhere)
    variances = walked**2 * times / times[-1]
    rows, fixed = np.searchsorted(times, everywhere), np.searchsorted(times, TWICE)
    for seed in range(60):
        generator = np.random.default_rng(seed)
        error, steps = np.degrees(COMPASS_DEVIATION) * generator.normal(), generator.normal(size=(len(times), 2))
        path = path_at(times) + np.cumsum(np.sqrt(np.diff(variances, prepend=0.0))[:, np.newaxis] * steps, axis=0)
        degrees = fixes_with(lasting(seed)).degrees
        fixes = PlacedFixes(TWICE, degrees, np.ones((len(TWICE), 2)), path[fixed], variances[fixed])
        known = of_compass(fixes, TRUTH.azimuth_deg + error, COMPASS_DEVIATION if azimuth_is_known else np.inf)
        found = adjusted(fixes, known)
        off = rotated(TRUTH.points(found.origin.degrees(path[rows])) - path_at(everywhere), np.array(TRUTH.yaw))
        stated = found.covariances(path[rows], variances[rows])
        squares.append(np.einsum("ka,kab,kb->k", off, np.linalg.inv(stated), off) / 2.0)
    means = np.mean(squares, axis=0)
    assert 0.7 < means.mean() < 1.3
    assert 0.5 < means.min() < means.max() < 1.8


def test_many_fixes_of_one_minute_tell_little_more_than_one():
    many, one = fixes_with(lasting(0)), fixes_with(lasting(0)[:1], TWICE[:1])
    minute = many.take(many.times < 600.0)
    deviations = [np.sqrt(adjusted(some, compass(some)).origin.covariance[0, 0]) for some in (one, minute)]
    assert 0.6 * deviations[0] < deviations[1] < deviations[0]


def test_jumps_of_reflections_do_not_count():
    errors = lasting(1)
    errors[10:25] += [30.0, -20.0]
    fixes = fixes_with(errors)
    found = adjusted(fixes, compass(fixes))
    assert found.outliers == 15
    assert np.hypot(*apart(found.origin, [0.0, 0.0])) < 3.0


def test_a_receiver_that_scatters_more_than_it_says_is_believed_less():
    errors = np.random.default_rng(2).normal(size=(len(TWICE), 2)) * 5.0
    honest, boasting = fixes_with(errors, stated=5.0), fixes_with(errors, stated=0.5)
    deviations = [adjusted(some, compass(some)).origin.covariance[0, 0] ** 0.5 for some in (honest, boasting)]
    assert deviations[1] > 0.7 * deviations[0]


def test_an_uncertain_path_is_believed_less_than_the_fixes_at_its_start():
    fixes = fixes_with(np.zeros((len(TWICE), 2)), stated=0.5, moved=10.0)
    found = adjusted(fixes, compass(fixes))
    assert np.hypot(*apart(found.origin, [0.0, 0.0])) < 1.0


def test_fixes_that_contradict_the_compass_count():
    fixes = fixes_with(lasting(3))
    found = adjusted(fixes, compass(fixes, error_deg=40.0))
    assert found.origin.azimuth_deg == pytest.approx(TRUTH.azimuth_deg, abs=3.0)
    assert "not 118; they count" in found.note


def test_without_a_compass_fixes_of_one_place_leave_the_azimuth_open():
    fixes = fixes_with(lasting(4)[:1], TWICE[:1])
    found = adjusted(fixes, of_compass(fixes, 90.0, np.inf))
    assert np.degrees(np.sqrt(found.origin.covariance[2, 2])) > 90.0


def test_a_place_that_is_sent_again_under_water_counts_once():
    fixes = [Fix(float(time), 41.2, 3.1 + 1e-6 * min(time, 3)) for time in range(50)]
    assert len(PlacedFixes.of(fixes, np.zeros((50, 2)), np.zeros(50))) == 4


def test_a_map_that_knows_its_place_is_moved_by_new_fixes_as_far_as_they_tell_more():
    known = Origin(TRUTH.latitude_deg, TRUTH.longitude_deg, TRUTH.azimuth_deg, np.diag([0.1, 0.1, 1e-4]))
    live = LiveOrigin(AskedOrigin(None), known)
    off = TRUTH.degrees(np.array([[30.0, 0.0]]))[0]
    origin = live.take(Fix(0.0, *off, (10.0, 10.0)), np.zeros(2), 0.0).origin
    assert np.hypot(*apart(origin, [0.0, 0.0])) < 0.1


def test_live_and_offline_find_the_same():
    times = TWICE[::4]
    fixes = fixes_with(lasting(5, times), times)
    live = LiveOrigin(AskedOrigin(None, TRUTH.azimuth_deg))
    for time, degrees, place in zip(fixes.times, fixes.degrees, fixes.places):
        origin = live.take(Fix(time, *degrees, (1.0, 1.0)), place, 0.0).origin
    np.testing.assert_allclose(origin.array, adjusted(fixes, compass(fixes)).origin.array, rtol=1e-6)


def message(**changed):
    """Return a NavSatFix as rosbags reads it from ROS 2."""
    stamp = SimpleNamespace(sec=5, nanosec=500_000_000)
    told = {"latitude": 41.2, "longitude": 3.1, "covariance": np.diag([4.0, 9.0, 16.0]).ravel(), "kind": 2, "status": 0}
    told.update(changed)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp), status=SimpleNamespace(status=told["status"]), latitude=told["latitude"],
        longitude=told["longitude"], position_covariance=told["covariance"], position_covariance_type=told["kind"],
    )  # fmt: skip


def test_a_message_tells_time_place_and_deviations():
    assert fix_of(message()) == Fix(5.5, 41.2, 3.1, (2.0, 3.0))


@pytest.mark.parametrize("changed", [{"kind": 0}, {"covariance": np.zeros(9)}, {"covariance": np.full(9, np.nan)}])
def test_a_receiver_that_does_not_tell_its_accuracy_is_taken_for_a_plain_one(changed):
    assert fix_of(message(**changed)).deviations == (UNKNOWN_DEVIATION, UNKNOWN_DEVIATION)


@pytest.mark.parametrize("changed", [{"status": -1}, {"latitude": np.nan}, {"latitude": 0.0, "longitude": 0.0}])
def test_a_receiver_without_a_fix_tells_no_place(changed):
    with pytest.raises(RefusedInput, match="status"):
        fix_of(message(**changed))
