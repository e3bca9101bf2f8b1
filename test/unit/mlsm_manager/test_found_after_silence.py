"""A vehicle with a compass whose sonar hears nothing for a while: it is found again, or nobody claims to know where."""

import numpy as np
import pytest
from made_compass import PARAMETERS, with_heading_only
from made_harbour import CANAL, HARBOUR, SONAR_IN_BASE, TURN, ahead, along_canal, tour

from mlsm_manager.joint_solver.compare.islands import MAP
from mlsm_manager.joint_solver.placing.turns import Turns
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.localisation.joint_session import JointSession

pytestmark = pytest.mark.long
BEGIN, SILENT, END = 14, 8, 24  # scans before the silence, in it, and in all


def run(path, corners, without):
    """Return the session after a tour of which the sonar heard nothing for a while, and the true path.

    without: makes of the scans in the silence what the session takes.
    """
    made = tour(END, path=path, corners=corners)
    scans = [with_heading_only(scan) for scan in made.scans]
    session = JointSession.begun(PARAMETERS, SONAR_IN_BASE, np.zeros(3), None, np.empty((0, 2)))
    for scan in scans[:BEGIN] + without(scans[BEGIN : BEGIN + SILENT]) + scans[BEGIN + SILENT :]:
        session.add(scan)
    return session, made.truth


def no_scans(scans):
    return []


def no_echoes(scans):
    return [scan.without_points(scan.reference_time) for scan in scans]


def errors(session, truth):
    """Return how far (n,) [m] the path is from the truth at all nodes."""
    times = session.solver.log.node_times
    return np.hypot(*(session.path(times) - truth.at(times) + truth.at(times[:1]))[:, :2].T)


@pytest.fixture(scope="module", params=[no_scans, no_echoes], ids=["no scans", "no echoes"])
def harbour(request):
    return run(ahead, HARBOUR, request.param)


@pytest.fixture(scope="module")
def canal():
    return run(along_canal, CANAL, no_echoes)


def test_a_vehicle_is_found_in_its_own_map(harbour):
    session, truth = harbour
    assert not session.solver.islands.is_apart
    assert errors(session, truth)[-3:].max() < 1.5


def test_scans_that_heard_nothing_do_not_count_as_beside_the_map(harbour):
    solver = harbour[0].solver
    turns = Turns.with_echoes(solver.estimates, solver.islands.apart, 1, solver.log.point_counts, 10)
    assert len(turns.times) == 10
    assert turns.times[0] < BEGIN * TURN < END * TURN - TURN < turns.times[-1]
    assert turns.agreements.min() > 0.9


def test_a_turn_counts_as_heard_where_one_of_its_parts_was(canal):
    """Of eight turns of three parts, in two no part heard anything."""
    solver = canal[0].solver
    turns = Turns.with_echoes(solver.estimates, solver.islands.apart, 3, solver.log.point_counts, END)
    assert len(turns.times) == END // 3 - 2


def test_the_map_is_provisional_until_a_second_scan_agrees():
    session = JointSession.begun(PARAMETERS, SONAR_IN_BASE, np.zeros(3), None, np.empty((0, 2)))
    told = []
    for scan in tour(4, path=ahead).scans:
        session.add(with_heading_only(scan))
        told.append(session.is_provisional)
    assert told[0]
    assert not told[-1]


def test_the_motion_in_a_silence_has_nodes(harbour):
    session, _ = harbour
    assert np.diff(session.solver.log.node_times).max() < 2.0 * TURN
    assert len(session.scans) == len(session.solver.estimates)


def test_a_place_that_could_be_several_is_told_as_unknown(canal):
    """Both walls of a canal look the same everywhere."""
    session, truth = canal
    estimate = session.solver.estimates[-1]
    assert session.solver.islands.is_apart
    error = errors(session, truth)[-1]
    assert error < 3.0 * np.sqrt(np.trace(estimate.pose_covariance[:2, :2]))


def test_scans_whose_place_is_unknown_are_compared_with_each_other(canal):
    session, _ = canal
    agreements = [estimate.agreement for estimate in session.solver.estimates]
    assert agreements[BEGIN + SILENT] == 0.0
    assert agreements[-1] > 0.5
    assert session.solver.islands.numbers[BEGIN + SILENT - 1] == MAP


def test_a_run_is_stored_with_what_lies_apart(canal):
    session, _ = canal
    again = session.copied().solver
    np.testing.assert_array_equal(again.islands.numbers, session.solver.islands.numbers)


def test_islands_of_another_number_of_scans_are_refused(canal):
    solver = canal[0].solver
    stored = {**solver.stored(), "islands": solver.islands.numbers[1:]}
    with pytest.raises(ValueError, match="islands"):
        LiveSolver.resumed(PARAMETERS, SONAR_IN_BASE, canal[0].scans, stored)
