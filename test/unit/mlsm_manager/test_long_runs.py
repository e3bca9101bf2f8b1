"""What a long live run forgets, and what it keeps."""

import sys

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, deaf, logged, tour
from made_models import followed, solver_parameters
from numba._dispatcher import compute_fingerprint

from mlsm_manager.joint_solver import live_solver
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.window import nearest_groups, superfluous
from mlsm_manager.localisation import joint_session
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_map import KeyframeMap
from mlsm_manager.scan_matching.scan import MapCloud
from node_support.numba_cache import LONGEST_DESCRIPTION

SCANS = tour(12).scans
EVERY_THIRD = np.arange(len(SCANS)) % 3 == 0


@pytest.fixture
def log():
    made = logged(SCANS)
    made.forget(EVERY_THIRD)
    return made


def test_points_of_forgotten_scans_are_gone_and_those_of_others_stay(log):
    whole = logged(SCANS)
    for scan in range(len(SCANS)):
        (found, scans), (before, _) = (one.surfaces.heard(scan, scan + 1) for one in (log, whole))
        np.testing.assert_array_equal(found.ranges, [] if EVERY_THIRD[scan] else before.ranges)
        assert set(scans) <= {scan}


def test_scans_go_on_after_some_are_forgotten(log):
    log.append(tour(13).scans[-1], 1.0)
    assert log.scan_count == 13
    assert log.surfaces.counts[-1] > 0
    assert not log.forgotten[-1]


def test_the_newest_scan_can_be_taken_back_after_some_are_forgotten(log):
    log.thin_odometry(6)
    length = len(log.odometry)
    log.append(tour(13).scans[-1], 1.0)
    log.shorten(12)
    assert (log.scan_count, len(log.odometry), len(log.forgotten)) == (12, length, 12)


def test_old_odometry_is_kept_once_in_a_second():
    log, whole = logged(SCANS), logged(SCANS)
    log.thin_odometry(8)
    start, end = log.node_times[[0, 8]]
    assert len(log.odometry) < 0.6 * len(whole.odometry)
    times = np.linspace(start, end + 30.0, 500)
    np.testing.assert_allclose(log.odometry.at(times), whole.odometry.at(times), atol=0.05)
    later = times[times > end]
    np.testing.assert_array_equal(log.odometry.at(later), whole.odometry.at(later))


def standing(groups, forgotten=(), compared=12):
    """Return a run of a vehicle that hears the same in so many groups of scans; those `forgotten` are.

    compared: with so many groups each scan is, and a quarter of them is enough beside each other.
    """
    parameters = solver_parameters(scans_per_group=1, frozen_scans=compared)
    scans = tour(groups).scans
    log = logged(scans)
    nodes = np.zeros((groups + 1, parameters.odometry.width))
    nodes[:, :2] -= log.node_poses(np.arange(groups + 1))[:, :2]
    log.forget(np.isin(np.arange(groups), forgotten))
    return Solution(log, parameters, State(nodes, np.zeros(2)))


@pytest.mark.parametrize(("forgotten", "first", "found"), [([], 0, [3, 4, 5]), ([1], 2, [1, 4, 5])])
def test_groups_with_enough_older_ones_beside_them_that_were_not_forgotten_are_superfluous(forgotten, first, found):
    np.testing.assert_array_equal(np.flatnonzero(superfluous(standing(6, forgotten), first, 6)), found)


def test_groups_elsewhere_are_kept():
    solution = standing(6)
    solution.state.nodes[4:, 0] += 10.0
    assert not superfluous(solution, 0, 6)[4:].any()


def test_forgotten_groups_are_none_of_the_nearest():
    np.testing.assert_array_equal(nearest_groups(standing(6, [0, 1], compared=3), 6).numbers, [2, 3, 4])


def round_and_round(times):
    """Return poses (n, 3) of a vehicle that goes round in a circle of two metres."""
    phase = times / 60.0
    return np.column_stack([np.cos(phase), np.sin(phase), phase])


@pytest.fixture
def forgetful(monkeypatch):
    """Forget what is older than 30 scans, six scans at once."""
    monkeypatch.setattr(live_solver, "_FORGOTTEN_AT_ONCE", 6)
    return solver_parameters(free_scans=5, frozen_scans=10, kept_scans=30)


def test_a_run_that_forgets_is_followed_as_one_that_does_not(forgetful):
    made = tour(60, path=round_and_round)
    solver = followed(made.scans, forgetful)
    assert np.count_nonzero(solver.log.forgotten) > 10
    assert solver.estimates[20] is None
    newest = solver.estimates[-1]
    assert np.hypot(*(newest.T_map_base - made.truth.at(newest.time))[:2]) < 0.3


def session_of(scans, parameters):
    session = JointSession.begun(parameters, SONAR_IN_BASE, np.zeros(3), None, np.empty((0, 2)))
    for scan in scans:
        session.add(scan)
    return session


@pytest.mark.long
def test_a_run_that_forgets_is_judged_as_one_that_does_not(forgetful):
    scans = tour(42, path=round_and_round).scans
    whole = [verdict.name for verdict in session_of(scans[:20], forgetful).verdicts()]
    session = session_of(scans, forgetful)
    assert session.solver.estimates[10] is None
    assert [verdict.name for verdict in session.verdicts()] == whole


@pytest.mark.long
def test_a_run_goes_on_after_a_silence_that_is_longer_than_what_it_keeps(forgetful):
    made = tour(58, path=round_and_round)
    session = session_of(deaf(made.scans, range(12, 56)), forgetful)
    newest = session.solver.estimates[-1]
    assert np.hypot(*(newest.T_map_base - made.truth.at(newest.time))[:2]) < 0.5
    assert {verdict.name for verdict in session.verdicts()}


def test_scans_are_kept_for_storing_only_as_many_as_are_stored(monkeypatch):
    monkeypatch.setattr(joint_session, "_MOST_STORED", 5)
    session = session_of([], solver_parameters())
    for number, scan in enumerate(SCANS[:8], start=1):
        session.add(scan)
        assert session.may_be_stored == (number <= 5)
        assert len(session.scans) == (number if number <= 5 else 0)


def test_numba_keeps_no_description_of_the_arguments_of_each_call(monkeypatch):
    """It keeps one of each kind, unless it is too long."""
    lengths = {}
    for module in [sys.modules[name] for name in sorted(sys.modules) if name.startswith("mlsm_manager.")]:
        for name, loop in list(vars(module).items()):
            if hasattr(loop, "py_func"):
                monkeypatch.setattr(module, name, watched(loop, lengths))
    session = session_of(SCANS[:4], solver_parameters())
    made = KeyframeMap(0.5, 1000.0)
    for scan in SCANS[:4]:
        made.add(MapCloud.of_scan(scan))
        made.draw(session, np.inf)
    made.map.remove(np.arange(3))
    assert {"weighed_pairs", "placed_rows", "summed_comparisons"} <= set(lengths)
    assert {name: length for name, length in lengths.items() if length > LONGEST_DESCRIPTION} == {}


def watched(loop, lengths):
    """Return a compiled loop that tells the length of the longest description of its tuples, by its name."""

    def call(*arguments):
        found = [len(compute_fingerprint(one)) for one in arguments if isinstance(one, tuple)]
        name = loop.py_func.__name__
        lengths[name] = max([lengths.get(name, 0), *found])
        return loop(*arguments)

    return call


def test_no_scan_that_is_stored_with_a_run_is_forgotten():
    assert solver_parameters().kept_scans >= joint_session._MOST_STORED
