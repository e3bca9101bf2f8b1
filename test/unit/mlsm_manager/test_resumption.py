"""A localiser that starts in a stored map: where it expects the vehicle, and how it finds a lost one."""

import numpy as np
import pytest
from made_scans import SECONDS, at_velocity, drifting, elsewhere, harbour, scan_of, still

from mlsm_manager.localisation.lost_vehicle import FoundPlace, PlaceSearch
from mlsm_manager.localisation.parameters import LocaliserParameters
from mlsm_manager.localisation.resumption import StoredPlace
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import Belief, MatchStatus, Track
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.surface_map.map_file import Layer, StoredMap, map_bytes, map_of_bytes
from node_support.geometry import composed

pytestmark = pytest.mark.long

PARAMETERS = LocaliserParameters(speed_deviation=0.05)


@pytest.fixture(scope="module")
def stored():
    """Return the map after five turns, as a file gives it back."""
    localiser = PARAMETERS.build_localiser()
    for turn in range(5):
        localiser.take_scan(drifting(turn))
    return map_of_bytes(map_bytes(localiser.stored("map", {"beam_width": 0.04}, 1.0, "run")))


def restored(stored, same_odometry):
    localiser = PARAMETERS.build_localiser()
    localiser.restore(stored, same_odometry)
    return localiser


def displaced(turn):
    """Return a scan of a vehicle at rest by an odometry whose frame lies elsewhere."""
    return scan_of(harbour(), still(), at_velocity((0.0, 0.0, 0.0), (30.0, -20.0, 0.0)), SECONDS * turn)


def test_all_layers_and_the_place_are_stored(stored):
    assert set(stored.layers) == set(Layer)
    assert min(len(blocks) for blocks in stored.layers.values()) > 50
    place = StoredPlace.of_arrays(stored.arrays)
    np.testing.assert_allclose(place.belief.theta[:2], [0.0, 0.0], atol=0.1)
    np.testing.assert_allclose(place.correction[:2], [-0.02 * SECONDS * 4, -0.01 * SECONDS * 4], atol=0.15)


def test_a_killed_node_goes_on_where_its_odometry_has_drifted_to(stored):
    localiser = restored(stored, same_odometry=True)
    assert not localiser.is_lost
    update = localiser.take_scan(drifting(6)).scan
    assert update.result.status is MatchStatus.CONVERGED
    np.testing.assert_allclose(update.result.pose, np.zeros(3), atol=0.1)


def test_until_the_first_scan_the_stored_correction_is_shown(stored):
    localiser = restored(stored, same_odometry=True)
    shown = localiser.following.correction(100.0, np.zeros(3))
    np.testing.assert_allclose(shown, stored.arrays["T_map_odom"], rtol=0.0, atol=1e-12)


def test_a_track_that_begins_after_the_restart_goes_straight_from_the_stored_place(stored):
    end = StoredPlace.of_arrays(stored.arrays).belief.time
    track = Track(np.array([end + 8.0, end + 9.0]), np.array([[0.8, 0.4, 0.0], [0.9, 0.5, 0.0]]))
    bridged = restored(stored, same_odometry=True).following.bridged(track)
    np.testing.assert_allclose(bridged.at(end), drifting(4).reference_pose, atol=1e-9)
    np.testing.assert_array_equal(bridged.at(track.times), track.poses)


@pytest.mark.parametrize(("same_odometry", "later"), [(True, 40.0), (True, -1.0), (False, 8.0)])
def test_a_track_stays_as_it_is_where_the_stored_place_says_nothing_of_it(stored, same_odometry, later):
    track = Track(StoredPlace.of_arrays(stored.arrays).belief.time + np.array([later]), np.zeros((1, 3)))
    assert restored(stored, same_odometry).following.bridged(track) is track


def test_another_odometry_is_found_anywhere_in_the_map(stored):
    localiser = restored(stored, same_odometry=False)
    assert localiser.is_lost
    one_scan, two_scans = (localiser.take_scan(displaced(turn)).scan for turn in range(2))
    assert (one_scan.accepted, one_scan.result.status) == (False, MatchStatus.AMBIGUOUS)
    assert two_scans.accepted, two_scans.result.reason
    np.testing.assert_allclose(two_scans.result.pose[:2], [0.0, 0.0], atol=0.1)
    assert not localiser.is_lost


def found_place(time, pose, T_odom_base):
    errors = OdometryErrors().covariance()
    errors[POSE, POSE] = np.diag(np.array([0.3, 0.3, 0.02]) ** 2)
    return FoundPlace(Belief(time, np.append(pose, np.zeros(5)), errors), T_odom_base)


@pytest.mark.parametrize(
    ("aside", "confirms"), [((0.5, 0.3, 0.02), True), ((5.0, 0.0, 0.0), False), ((0.0, 0.0, 0.5), False)]
)
def test_a_place_is_confirmed_where_the_odometry_leads_to_the_next_one(aside, confirms):
    """Scans of water that the map does not have are each found on another part of it."""
    odometry, place, step = np.array([30.0, -20.0, 2.0]), np.array([4.0, 5.0, 0.5]), np.array([4.0, 1.0, 0.3])
    later = found_place(116.0, composed(place, step) + np.array(aside), composed(odometry, step))
    assert found_place(100.0, place, odometry).leads_to(later, OdometryErrors()) == confirms


@pytest.mark.parametrize("scans", [[elsewhere(1)], [displaced(0), displaced(500)]], ids=["elsewhere", "too late"])
def test_a_lost_vehicle_that_nothing_confirms_does_not_write_into_the_map(stored, scans):
    """After a time in which the odometry strays far the next scan confirms nothing."""
    localiser = restored(stored, same_odometry=False)
    before = localiser.blocks.rows.copy()
    assert not any(localiser.take_scan(scan).scan.accepted for scan in scans)
    np.testing.assert_array_equal(localiser.blocks.rows, before)
    assert localiser.is_lost


def test_a_map_of_another_resolution_is_refused_and_the_present_one_stays(stored):
    localiser = PARAMETERS.changed({"resolution": 0.25}).build_localiser()
    localiser.take_scan(drifting(0))
    count = localiser.block_count
    with pytest.raises(ValueError, match=r"resolution 0\.5 m: must be the map's, 0\.25 m"):
        localiser.restore(stored, same_odometry=True)
    assert (localiser.block_count, localiser.is_lost) == (count, False)


def test_a_map_without_a_matched_layer_is_matched_with_as_it_is_shown(stored):
    shown_only = StoredMap("map", {Layer.SHOWN: stored.layers[Layer.SHOWN]})
    localiser = restored(shown_only, same_odometry=False)
    assert len(localiser.estimator.matched) == len(stored.layers[Layer.SHOWN])


@pytest.mark.parametrize("name", ["T_map_odom", "time", "state", "covariance"])
@pytest.mark.parametrize("value", [None, np.zeros(2), np.full((8, 8), np.nan)])
def test_a_place_that_is_not_whole_is_none(stored, name, value):
    arrays = {key: array for key, array in {**stored.arrays, name: value}.items() if array is not None}
    assert StoredPlace.of_arrays(arrays) is None


def test_a_match_ends_the_search():
    search = PlaceSearch()
    search.expect()
    for accepted in (False, True, False, False, False, False):
        search.learn(accepted)
    assert not search.is_lost
