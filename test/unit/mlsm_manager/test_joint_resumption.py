"""A node with the joint solver that was killed goes on with its run, where its vehicle is where it was."""

from dataclasses import replace

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, TURN, selected, tour

from mlsm_manager.localisation.joint_session import moved
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.surface_map.map_file import map_bytes, map_of_bytes

pytestmark = pytest.mark.long

HARBOUR = tour(14, direction=0.05)
KILLED_AFTER = 9
FREE_SCANS = 4
PARAMETERS = MlsmCoreParameters(size_x_meters=0.0, size_y_meters=0.0, free_scans=FREE_SCANS)


def new_localiser(**changes):
    return PARAMETERS.changed(changes).build_localiser(SONAR_IN_BASE)


def taken(localiser, scans):
    return [localiser.take_scan(scan).scan for scan in scans]


@pytest.fixture(scope="module")
def killed():
    """Return the localiser that was killed."""
    localiser = new_localiser()
    taken(localiser, HARBOUR.scans[:KILLED_AFTER])
    return localiser


@pytest.fixture(scope="module")
def stored(killed):
    return map_of_bytes(map_bytes(killed.stored("map", {}, 0.0, "run")))


@pytest.fixture(scope="module")
def whole():
    """Return a localiser that was never killed, and what it found at each scan."""
    localiser = new_localiser()
    return localiser, taken(localiser, HARBOUR.scans)


def resumed(stored, has_run=True):
    """Return a localiser that starts in a stored map, with its run or with the place alone."""
    place = {name: array for name, array in stored.arrays.items() if not name.startswith("run.")}
    localiser = new_localiser()
    localiser.restore(stored if has_run else replace(stored, arrays=place), same_odometry=True)
    return localiser


def begun_anew(scans):
    """Return the scans as an odometry places them that counts from elsewhere."""
    return [moved(scan, np.array([12.0, -9.0, 0.4])) for scan in scans]


def sector_of(scan, beams=14):
    """Return the first beams of a scan, which hear one wall and say nothing of the way along it."""
    return selected(scan, np.arange(beams))


def test_a_resumed_run_goes_on_as_if_it_had_never_ended(stored, whole):
    halves, (whole, wanted) = resumed(stored), whole
    for one, other in zip(taken(halves, HARBOUR.scans[KILLED_AFTER:]), wanted[KILLED_AFTER:]):
        np.testing.assert_allclose(one.belief.theta, other.belief.theta, atol=1e-9)
        np.testing.assert_allclose(one.belief.covariance, other.belief.covariance, atol=1e-9)
    assert halves.block_count == whole.block_count
    np.testing.assert_allclose(np.sort(halves.blocks.mean, axis=0), np.sort(whole.blocks.mean, axis=0), atol=1e-4)


def test_what_was_stored_stays_as_it_is_while_scans_are_taken(stored):
    """A file is written from it while the node goes on."""
    localiser = resumed(stored)
    for scan in HARBOUR.scans[KILLED_AFTER : KILLED_AFTER + 3]:
        saved = localiser.stored("map", {}, 0.0, "run")
        before = map_bytes(saved)
        localiser.take_scan(scan)
        assert map_bytes(saved) == before


@pytest.mark.parametrize("has_run", [True, False])
def test_a_vehicle_whose_odometry_began_anew_writes_nothing_before_it_is_found(stored, has_run):
    localiser = resumed(stored, has_run)
    before = localiser.blocks.rows.copy()
    updates = taken(localiser, begun_anew(HARBOUR.scans[KILLED_AFTER : KILLED_AFTER + 3]))
    assert [update.accepted for update in updates] == [False, False, False]
    assert localiser.is_lost
    np.testing.assert_array_equal(localiser.blocks.rows, before)


@pytest.mark.parametrize("has_run", [True, False])
def test_a_scan_that_says_too_little_to_be_matched_is_enough_for_a_run_to_go_on(stored, has_run):
    scan = HARBOUR.scans[KILLED_AFTER]
    (update,) = taken(resumed(stored, has_run), [sector_of(scan)])
    assert update.accepted == has_run
    if has_run:
        assert np.hypot(*(update.belief.theta[:2] - HARBOUR.truth.at(scan.reference_time)[:2])) < 0.5


def test_a_run_goes_on_with_a_scan_whose_first_half_lacks_odometry(stored, whole):
    _, wanted = whole
    localiser, scan = resumed(stored), HARBOUR.scans[KILLED_AFTER]
    known = scan.track.times > scan.reference_time - TURN / 2.0
    track = localiser.following.bridged(Track(scan.track.times[known], scan.track.poses[known]))
    (update,) = taken(localiser, [replace(scan, track=track).with_odometry()])
    assert len(update.scan) == len(scan)
    np.testing.assert_allclose(update.belief.theta[:2], wanted[KILLED_AFTER].belief.theta[:2], atol=0.1)


def test_a_scan_without_echoes_after_a_restart_leaves_the_run_for_the_next_one(stored):
    localiser = resumed(stored)
    silent, heard = HARBOUR.scans[KILLED_AFTER : KILLED_AFTER + 2]
    updates = taken(localiser, [sector_of(silent, beams=0), heard])
    assert [update.accepted for update in updates] == [False, True]


@pytest.mark.parametrize("has_run", [True, False])
def test_it_is_found_by_relocalisation_and_no_wall_is_there_twice(killed, stored, whole, has_run):
    whole, wanted = whole
    localiser = resumed(stored, has_run)
    updates = taken(localiser, begun_anew(HARBOUR.scans[KILLED_AFTER:]))
    assert [update.accepted for update in updates[:5]] == [False, False, False, False, True]
    assert not localiser.is_lost
    np.testing.assert_allclose(updates[-1].belief.theta[:2], wanted[-1].belief.theta[:2], atol=0.5)
    walls = {tuple(cell) for cell in whole.blocks.cells.tolist()}
    beside = sum(tuple(cell) not in walls for cell in localiser.blocks.cells.tolist())
    assert beside < 0.2 * killed.block_count


def test_a_jump_in_time_after_the_start_makes_the_place_unknown(stored):
    localiser = resumed(stored)
    localiser.notice_time(0.0)
    assert localiser.is_lost


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("run.T_map_odom", np.zeros(2)),
        ("run.solver.nodes", np.zeros((3, 5))),
        ("run.scan.reference_time", np.zeros(2)),
        ("run.solver.estimate.time", np.zeros(2)),
        ("run.solver.estimate.node", None),
    ],
)
def test_a_run_that_does_not_fit_leaves_the_map_alone(stored, name, array):
    assert name in stored.arrays
    arrays = {key: value for key, value in {**stored.arrays, name: array}.items() if value is not None}
    localiser = resumed(replace(stored, arrays=arrays))
    assert localiser.estimator.session is None
    assert localiser.block_count == len(stored.shown)
    assert taken(localiser, HARBOUR.scans[KILLED_AFTER : KILLED_AFTER + 1])[0].accepted


@pytest.mark.parametrize(
    ("kind", "other", "told"),
    [("AUTO", "THRUSTERS", "DvlFactors, not ThrusterFactors"), ("THRUSTERS", "NONE", "ThrusterFactors, not Unaided")],
)
def test_a_run_with_another_odometry_profile_is_refused_also_where_it_has_as_many_unknowns(kind, other, told):
    before, after = new_localiser(odometry=kind), new_localiser(odometry=other)
    taken(before, HARBOUR.scans[:3])
    reason = after.restore(before.stored("map", {}, 0.0, "run"), same_odometry=True)
    assert reason.startswith(f"it was stored with another odometry profile: {told}")
    assert (after.estimator.session, after.block_count) == (None, before.block_count)


def test_a_run_is_only_stored_for_the_run_of_the_graph_that_can_go_on_with_it(killed):
    assert not any(name.startswith("run.") for name in killed.stored("map", {}, 0.0, "").arrays)
