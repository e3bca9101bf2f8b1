"""Where the free space of a map begins, and which of its maps lose what beams go through, with either estimator."""

from functools import lru_cache

import numpy as np
import pytest
from made_scans import harbour, scan_of, still, wall

from mlsm_manager.localisation.clouds import MapCloud
from mlsm_manager.localisation.localiser import MapInput
from mlsm_manager.localisation.parameters import EstimatorName, MlsmCoreParameters
from mlsm_manager.surface_map.map_file import Layer

SONAR_IN_BASE = (5.0, 0.0)
GHOST = np.array([[2.1, 5.1]])
"""An echo between the vehicle and the harbour's wall that is heard once."""


def localiser_of(estimator, **changes):
    parameters = MlsmCoreParameters(estimator=estimator, map_input=MapInput.MATCHED, **changes)
    return parameters.build_localiser(SONAR_IN_BASE)


@lru_cache(maxsize=None)
def layers_with_a_ghost(estimator, matching, carve):
    """Return the maps after a scan with the ghost and eight without it."""
    changes = {"crossings_least": 2, "crossings_per_point": 1.0, "free_scans": 2}
    localiser = localiser_of(estimator, start_matching=matching, carve=carve, **changes)
    localiser.mount(np.zeros(2))
    for turn in range(9):
        places = np.vstack([harbour(), GHOST]) if turn == 0 else harbour()
        localiser.take_scan(scan_of(places, still(), start=16.0 * turn))
    return localiser.estimator.layers


def has_ghost(blocks):
    return bool((np.hypot(*(blocks.mean[:, :2] - GHOST).T) < 0.3).any())


@pytest.mark.parametrize("estimator", list(EstimatorName))
@pytest.mark.parametrize("matching", [False, True])
def test_free_space_begins_at_the_sonar_and_not_at_the_vehicles_origin(estimator, matching):
    localiser = localiser_of(estimator, start_matching=matching)
    localiser.take_scan(scan_of(wall((12.0, -2.0), (12.0, 2.0)), still()))
    cells = localiser.free.centers
    assert cells[:, 0].min() == pytest.approx(SONAR_IN_BASE[0], abs=0.5)


@pytest.mark.parametrize("matching", [False, True])
def test_a_sonar_that_is_placed_later_counts_from_then_on(matching):
    localiser = localiser_of(EstimatorName.SCAN_BY_SCAN, start_matching=matching)
    localiser.mount(np.array([8.0, 0.0]))
    localiser.take_scan(scan_of(wall((12.0, -2.0), (12.0, 2.0)), still()))
    assert localiser.free.centers[:, 0].min() == pytest.approx(8.0, abs=0.5)


@pytest.mark.parametrize("estimator", list(EstimatorName))
@pytest.mark.parametrize("layer", [Layer.SHOWN, Layer.MATCHED])
@pytest.mark.parametrize("matching", [False, True])
def test_a_block_that_beams_go_through_leaves_both_maps(estimator, layer, matching):
    kept = layers_with_a_ghost(estimator, matching, carve=False)[layer]
    carved = layers_with_a_ghost(estimator, matching, carve=True)[layer]
    assert has_ghost(kept)
    assert not has_ghost(carved)
    assert len(carved) > 0.9 * len(kept)


@pytest.mark.parametrize("estimator", list(EstimatorName))
@pytest.mark.parametrize("carve", [False, True])
def test_without_matching_the_map_does_not_depend_on_whether_clouds_come_before_or_after_their_scans(estimator, carve):
    after, before = (shown_in_order(estimator, cloud_first, carve) for cloud_first in (False, True))
    assert has_ghost(before.blocks) == has_ghost(after.blocks) == (not carve)
    np.testing.assert_allclose(before.blocks.mean, after.blocks.mean)
    np.testing.assert_allclose(before.free.centers, after.free.centers)
    assert (len(after.free) > 0) == carve


@pytest.mark.parametrize("estimator", list(EstimatorName))
def test_a_cloud_whose_scan_never_comes_is_in_the_map_and_carves_nothing(estimator):
    localiser = shown_in_order(estimator, True, True, scans=0)
    assert has_ghost(localiser.blocks)
    assert len(localiser.free) == 0


@pytest.mark.parametrize("estimator", list(EstimatorName))
def test_clouds_that_came_before_matching_began_carve_nothing_later(estimator):
    localiser = shown_in_order(estimator, True, True, scans=0)
    localiser.match(True)
    localiser.take_scan(scan_of(harbour(), still()))
    localiser.match(False)
    localiser.take_scan(scan_of(harbour(), still(), start=16.0))
    assert len(localiser.free) == 0


def shown_in_order(estimator, cloud_first, carve, scans=9):
    """Return the localiser after nine clouds, the first with a ghost, each before or after its scan of echoes.

    scans: how many of the scans come at all.
    """
    parameters = MlsmCoreParameters(
        estimator=estimator, start_matching=False, carve=carve,
        crossings_least=2, crossings_per_point=1.0, free_scans=2,
    )  # fmt: skip
    localiser = parameters.build_localiser((0.0, 0.0))
    for turn in range(9):
        heard = scan_of(np.vstack([harbour(), GHOST]) if turn == 0 else harbour(), still(), start=16.0 * turn)
        steps = [lambda heard=heard: localiser.take_cloud(MapCloud.of_scan(heard))]
        if turn < scans:
            steps.insert(1 if cloud_first else 0, lambda heard=heard: localiser.take_scan(heard))
        for step in steps:
            step()
    return localiser
