"""Whether scans lie on what was heard before them, and what scans that fit nowhere do to the told deviation."""

from dataclasses import replace

import numpy as np
import pytest
from made_models import DVL, HEADING, solution_of
from made_posts import heard, true_path

from mlsm_manager.joint_solver.map_support import misfit_variances, shares_heard_before
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.run_log import RunLog

TURNS = 4


def logged(scans):
    result = RunLog(np.zeros(2))
    for scan in scans:
        result.append(scan, 1.0)
    return result


@pytest.fixture(scope="module")
def log():
    return logged(heard(TURNS))


def measured(measure, log, aside, model=HEADING):
    """Return what `measure` finds where the nodes lie `aside` (n,) [m] across the canal of their true places."""
    nodes = np.zeros((log.scan_count + 1, model.width))
    nodes[:, :2] = true_path(log.node_times)
    nodes[:, 1] = aside
    return measure(solution_of(log, model, State(nodes, np.zeros(2))), 0)


def shares_at(log, step):
    """Return the shares where each scan lies `step` [m] across the canal of the one before."""
    return measured(shares_heard_before, log, step * np.arange(log.scan_count + 1))


def variances_at(log, aside, model=HEADING):
    """Return the variances where the last scan lies `aside` [m] across the canal of its true place."""
    return measured(misfit_variances, log, np.append(np.zeros(log.scan_count), aside), model)


def test_scans_lie_on_what_was_heard_before_where_they_are_and_not_where_they_are_not(log):
    assert shares_at(log, 0.0)[1:].min() > 0.8
    assert shares_at(log, 5.0)[1:].max() < 0.2


def test_new_surfaces_say_nothing_against_a_place():
    """As of a scan whose echoes lie 100 m along the canal, out of sight of all others."""
    scans = heard(3)
    far = replace(scans[2], points=scans[2].points + np.array([100.0, 0.0, 0.0, 0.0]))
    assert np.isnan(shares_at(logged([*scans[:2], far]), 0.0)[2])


def test_the_first_scan_has_none_before_it(log):
    assert np.isnan(shares_at(log, 0.0)[0])


def test_scans_at_their_places_leave_the_path_as_certain_as_it_is(log):
    np.testing.assert_array_equal(variances_at(log, 0.0), np.zeros(TURNS))


def test_the_place_is_the_less_certain_the_worse_a_scan_fits(log):
    found = [variances_at(log, aside)[-1] for aside in (0.0, 2.5, 4.0, 6.0)]
    assert np.all(np.diff(found) > 0.0)


def test_a_turn_in_which_nothing_fits_is_as_uncertain_as_a_vehicle_goes_far(log):
    seconds = np.diff(log.node_times)[-1]
    assert 0.2 * seconds < np.sqrt(variances_at(log, 7.0)[-1]) <= 0.5 * seconds


def test_a_reported_motion_is_not_lost_with_a_scan(log):
    np.testing.assert_array_equal(variances_at(log, 6.0, DVL), np.zeros(TURNS))
