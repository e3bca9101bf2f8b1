"""A vehicle whose sonar hears nothing for a while: it is found again, or nobody claims to know where."""

import numpy as np
import pytest
from made_harbour import (
    CANAL,
    HARBOUR,
    SONAR_IN_BASE,
    TURN,
    ahead,
    along_canal,
    deaf,
    selected,
    tour,
    without_positions,
)
from made_models import HEADING, solver_parameters
from made_scans import wall

from mlsm_manager.joint_solver.estimate import Turns
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.solution import MAP
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.scan_matching.scan import MapCloud

pytestmark = pytest.mark.long
BEGIN, SILENT, END = 14, 8, 24  # scans before the silence, in it, and in all


PARAMETERS = solver_parameters(
    odometry=HEADING, sonar_delay_deviation=1.0, scans_per_group=1, normal_deviation=0.2, free_scans=12
)


def run(path, corners, without):
    """Return the session after a tour of which the sonar heard nothing for a while, and the true path.

    without: makes of the scans in the silence what the session takes.
    """
    made = tour(END, path=path, corners=corners)
    scans = [without_positions(scan) for scan in made.scans]
    session = JointSession.begun(PARAMETERS, SONAR_IN_BASE, np.zeros(3), None, np.empty((0, 2)))
    for scan in scans[:BEGIN] + without(scans[BEGIN : BEGIN + SILENT]) + scans[BEGIN + SILENT :]:
        session.add(scan)
    return session, made.truth


def no_echoes(scans):
    return deaf(scans, range(len(scans)))


def errors(session, truth):
    """Return how far (n,) [m] the path is from the truth at all nodes."""
    times = session.solver.log.node_times
    return np.hypot(*(session.path(times) - truth.at(times) + truth.at(times[:1]))[:, :2].T)


@pytest.fixture(scope="module", params=[lambda scans: [], no_echoes], ids=["no scans", "no echoes"])
def harbour(request):
    return run(ahead, HARBOUR, request.param)


@pytest.fixture(scope="module")
def canal():
    return run(along_canal, CANAL, no_echoes)


def test_a_vehicle_is_found_in_its_own_map(harbour):
    session, truth = harbour
    assert not session.solver.submaps.is_apart
    assert errors(session, truth)[-3:].max() < 1.5


def test_scans_that_heard_nothing_do_not_count_as_beside_the_map(harbour):
    solver = harbour[0].solver
    turns = Turns.with_echoes(solver.estimates, solver.submaps.apart, 1, solver.log.surfaces.counts, 10)
    assert len(turns.times) == 10
    assert turns.times[0] < BEGIN * TURN < END * TURN - TURN < turns.times[-1]
    assert turns.agreements.min() > 0.9


def test_a_turn_counts_as_heard_where_one_of_its_parts_was(canal):
    """Of eight turns of three parts, in two no part heard anything."""
    solver = canal[0].solver
    turns = Turns.with_echoes(solver.estimates, solver.submaps.apart, 3, solver.log.surfaces.counts, END)
    assert len(turns.times) == END // 3 - 2


def test_the_map_is_provisional_until_a_second_scan_agrees():
    session = JointSession.begun(PARAMETERS, SONAR_IN_BASE, np.zeros(3), None, np.empty((0, 2)))
    told = []
    for scan in tour(4, path=ahead).scans:
        session.add(without_positions(scan))
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
    assert session.solver.submaps.is_apart
    error = errors(session, truth)[-1]
    assert error < 3.0 * np.sqrt(np.trace(estimate.pose_covariance[:2, :2]))


def test_scans_whose_place_is_unknown_are_compared_with_each_other(canal):
    session, _ = canal
    agreements = [estimate.agreement for estimate in session.solver.estimates]
    assert agreements[BEGIN + SILENT] == 0.0
    assert agreements[-1] > 0.5
    assert session.solver.submaps.numbers[BEGIN + SILENT - 1] == MAP


def test_a_run_is_stored_with_what_lies_apart(canal):
    session, _ = canal
    again = session.copied().solver
    np.testing.assert_array_equal(again.submaps.numbers, session.solver.submaps.numbers)


def test_submaps_of_another_number_of_scans_are_refused(canal):
    solver = canal[0].solver
    stored = {**solver.stored(), "islands": solver.submaps.numbers[1:]}
    with pytest.raises(ValueError, match="submaps"):
        LiveSolver.resumed(PARAMETERS, solver.log, stored)


WEST, EAST = 6, 2  # scans before the silence and after it
EDGE = 5.0
"""m: before the silence the sonar hears what is west of it, afterwards what is east of it."""


def run_in(known):
    """Return the session and the true path; known: (n, 2) m, blocks of the map that the run begins in."""
    made = tour(WEST + SILENT + EAST, path=ahead)
    first = made.truth.at(np.zeros(1))[0] * [1.0, 1.0, 0.0]
    session = JointSession.begun(PARAMETERS, SONAR_IN_BASE, first, np.array([0.3, 0.3, 0.02]), known)
    for scan in made.scans[:WEST]:
        session.add(without_positions(selected(scan, scan.points[:, 0] < EDGE)))
    for scan in made.scans[-EAST:]:
        session.add(without_positions(selected(scan, scan.points[:, 0] > EDGE)))
    return session, made.truth


def test_the_vehicle_is_found_where_only_the_loaded_map_was_heard():
    walls = [wall(start, end, 0.5) for start, end in zip(HARBOUR, np.roll(HARBOUR, -1, axis=0))]
    session, truth = run_in(np.concatenate(walls))
    assert not session.solver.submaps.is_apart
    times = session.solver.log.node_times[-EAST:]
    assert np.hypot(*(session.path(times) - truth.at(times))[:, :2].T).max() < 1.0


def test_without_the_loaded_map_its_place_is_unknown():
    assert run_in(np.empty((0, 2)))[0].solver.submaps.is_apart


BEFORE, SILENCE, SINCE = 10, 5, 3
CARRIED = 150.0
"""s: the vehicle is carried in the silence to where it would have been so much later, farther than it goes itself."""


def carried(times):
    """Return the poses (m, 3) at `times` (m,)."""
    return ahead(np.where(times > (BEFORE + 1.5) * TURN, times + CARRIED, times))


def far_from(blocks, others):
    """Return how many of `blocks` are more than 2 m from all `others`."""
    distance = np.linalg.norm(blocks.mean[:, np.newaxis, :2] - others.mean[:, :2], axis=-1)
    return int((distance.min(axis=1) > 2.0).sum())


def test_a_vehicle_found_in_the_map_from_before_takes_out_of_it_what_lay_apart_since():
    made = tour(BEFORE + SILENCE + SINCE, path=carried)
    localiser = MlsmCoreParameters().changed(profile_values(OdometryKind.HEADING)).build_localiser(SONAR_IN_BASE)

    def take(scans):
        for scan in map(without_positions, scans):
            localiser.take_scan(scan)
            localiser.take_cloud(MapCloud.of_scan(scan))

    take(made.scans[:BEFORE])
    before = localiser.blocks
    take(made.scans[-SINCE:])
    assert far_from(localiser.blocks, before) > 50
    found = localiser.relocalise()
    assert (found.accepted, found.forgotten) == (True, SINCE)
    begin, end = made.truth.at(np.array([0.0, made.scans[-1].reference_time]))
    np.testing.assert_allclose(found.result.pose[:2], (end - begin)[:2], atol=0.3)
    assert far_from(localiser.blocks, before) == 0
