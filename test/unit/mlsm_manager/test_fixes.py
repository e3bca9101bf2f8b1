"""Single scans that are found in the map while the odometry's scale is hardly known, and what their fixes tell."""

from dataclasses import replace

import numpy as np
import pytest
from made_scans import at_velocity, harbour, scan_of

from mlsm_manager.joint_solver.solution import Fix, Fixes
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.localisation.parameters import LocaliserParameters

SCALE = 1.3
SPEED = 0.2


def scans(count):
    """Return scans of a vehicle that rests in the first and goes 3.2 m in each other; its odometry reports 2.5 m."""
    truth, odometry = (at_velocity((speed, 0.0, 0.0)) for speed in (SPEED, SPEED / SCALE))
    starts = 16.0 * (np.arange(count) - 1.0)
    return [scan_of(harbour(offset=start / 160.0 + 0.1), truth, odometry, start, moving=True) for start in starts]


def localised(**changes):
    """Return by how much positions are off, m, and the solvers."""
    localiser = LocaliserParameters(**changes).build_localiser()
    taken = scans(4)
    found = np.array([localiser.take_scan(scan).scan.belief.theta[:2] for scan in taken])
    off = np.hypot(*(found - [[SPEED * 16.0 * turn, 0.0] for turn in range(len(taken))]).T)
    return off, localiser.estimator.session.rivals


def test_while_the_scale_is_hardly_known_scans_are_found_from_the_second_on():
    off, rivals = localised(odometry=OdometryKind.AUTO)
    assert 2 in rivals.shown.fixes
    assert off[1:].max() < 0.3


def test_where_a_scan_was_found_both_odometries_lead_to_it():
    _, rivals = localised(odometry=OdometryKind.AUTO)
    assert rivals.doubt.apart < 0.1
    assert rivals.shown.estimates[-1].stated_deviation < 0.3


def test_where_the_scale_is_known_no_scan_is_searched():
    _, rivals = localised(odometry=OdometryKind.DVL)
    assert not rivals.shown.fixes


@pytest.mark.parametrize(("metres", "is_found"), [(0.0, True), (1.0, False)])
def test_in_a_map_whose_newest_scans_are_uncertain_no_scan_is_searched(metres, is_found):
    localiser = LocaliserParameters(odometry=OdometryKind.AUTO).build_localiser()
    *known, newest = scans(4)
    for scan in known:
        localiser.take_scan(scan)
    estimates = localiser.estimator.session.solver.estimates
    covariance = estimates[-1].covariance + metres**2 * np.eye(len(estimates[-1].covariance))
    estimates[-1] = replace(estimates[-1], covariance=covariance)
    localiser.take_scan(newest)
    assert (4 in localiser.estimator.session.solver.fixes) == is_found


def test_a_fix_is_what_the_scan_says_and_not_what_was_expected():
    expected, of_expected = np.array([1.0, 0.0]), np.diag([4.0, 1.0])
    said, of_said = np.array([2.0, 1.0]), np.array([[0.25, 0.1], [0.1, 0.5]])
    of_both = np.linalg.inv(np.linalg.inv(of_expected) + np.linalg.inv(of_said))
    both = expected + of_both @ np.linalg.solve(of_said, said - expected)
    fix = Fix.without_prior(both, of_both, expected, of_expected)
    np.testing.assert_allclose(fix.information, np.linalg.inv(of_said))
    np.testing.assert_allclose(fix.place, said)


def test_fixes_are_stored_and_taken_back():
    fixes = Fixes({3: Fix(np.arange(2.0), np.eye(2)), 7: Fix(np.ones(2), 2.0 * np.eye(2))})
    again = Fixes.of_arrays(fixes.stored())
    assert list(again) == [3, 7]
    np.testing.assert_array_equal(again[7].information, 2.0 * np.eye(2))
    assert Fixes.of_arrays(Fixes().stored()) == Fixes()
