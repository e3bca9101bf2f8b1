"""What scans that fit nowhere do to the told deviation."""

import numpy as np
import pytest
from made_models import DVL, HEADING, solver_parameters
from made_posts import heard, true_path

from mlsm_manager.joint_solver.compare.map_support import misfit_variances
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.unknowns.state import State

TURNS = 4


@pytest.fixture(scope="module")
def log():
    result = RunLog(np.zeros(2))
    for scan in heard(TURNS):
        result.append(scan, 1.0)
    return result


def variances_at(log, aside, odometry=None):
    """Return the variances where the last scan lies `aside` [m] across the canal of its true place."""
    odometry = odometry or HEADING
    nodes = np.zeros((log.scan_count + 1, odometry.width))
    nodes[:, :2] = true_path(log.node_times)
    nodes[-1, 1] = aside
    return misfit_variances(log, odometry, State(nodes, np.zeros(2)), solver_parameters(), 0)


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
