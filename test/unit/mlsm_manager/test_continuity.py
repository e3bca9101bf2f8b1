"""Whether scans lie on what was heard before them."""

from dataclasses import replace

import numpy as np
import pytest
from made_models import HEADING, solver_parameters
from made_posts import heard, true_path

from mlsm_manager.joint_solver.compare.map_support import shares_heard_before
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.unknowns.state import State
from mlsm_manager.self_check.map_checks import scans_go_on

SECONDS = 14.0


@pytest.fixture(scope="module")
def log():
    result = RunLog(np.zeros(2))
    for scan in heard(4):
        result.append(scan, 1.0)
    return result


def shifted(scan, along):
    """Return a scan whose echoes lie `along` the canal by so much [m]: out of sight of all others."""
    return replace(scan, points=scan.points + np.array([along, 0.0, 0.0, 0.0]))


def shares_at(log, aside):
    """Return the shares where each scan is displaced across the canal by `aside` [m] against the one before."""
    odometry = HEADING
    nodes = np.zeros((log.scan_count + 1, odometry.width))
    nodes[:, :2] = true_path(log.node_times)
    nodes[:, 1] = aside * np.arange(len(nodes))
    return shares_heard_before(log, odometry, State(nodes, np.zeros(2)), solver_parameters(), 0)


def test_scans_at_their_places_lie_on_what_was_heard_before(log):
    assert shares_at(log, 0.0)[1:].min() > 0.8


def test_displaced_scans_do_not(log):
    assert shares_at(log, 5.0)[1:].max() < 0.2


def test_new_surfaces_say_nothing_against_a_place():
    log = RunLog(np.zeros(2))
    for scan in [*heard(2), shifted(heard(3)[2], 100.0)]:
        log.append(scan, 1.0)
    assert np.isnan(shares_at(log, 0.0)[2])


def test_the_first_scan_has_none_before_it(log):
    assert np.isnan(shares_at(log, 0.0)[0])


def run_of(lying, share=0.2):
    """Return the verdict on 30 scans of which `lying` (n,) have `share` of their points on those before."""
    shares = np.full(30, 0.9)
    shares[lying] = share
    return scans_go_on(SECONDS * np.arange(30), shares)


def test_four_scans_of_twenty_beside_the_others_are_no_reason_to_doubt():
    assert not run_of([10, 14, 18, 22], share=0.0).fires


def test_a_third_of_the_scans_beside_the_others_is():
    verdict = run_of(np.arange(10, 19))
    assert verdict.fires
    assert verdict.doubtful[0, 0] <= 10 * SECONDS
    assert verdict.doubtful[-1, 1] >= 18 * SECONDS


def test_the_figure_falls_with_the_shares_of_the_scans_that_fit_worst():
    values = [run_of(np.arange(10, 19), share).value for share in (0.8, 0.6, 0.4)]
    np.testing.assert_allclose(values, [0.8, 0.6, 0.4])


def test_few_scans_say_too_little():
    assert "too little" in scans_go_on(SECONDS * np.arange(10), np.full(10, 0.1)).line()


def test_scans_without_points_are_left_out():
    shares = np.where(np.arange(50) % 2, np.nan, 0.9)
    assert not scans_go_on(SECONDS * np.arange(50), shares).fires
