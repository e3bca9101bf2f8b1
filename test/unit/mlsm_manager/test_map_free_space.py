"""Free space: what beams crossed before their first echo, what that says against blocks, and where it begins."""

from functools import lru_cache

import numpy as np
import pytest
from made_scans import harbour, scan_of, still, wall

from mlsm_manager.localisation.localiser import MapInput
from mlsm_manager.localisation.parameters import EstimatorName, MlsmCoreParameters
from mlsm_manager.scan_matching.scan import MapCloud
from mlsm_manager.surface_map.free_space import Carver, CarvingParameters, FirstEchoes, beam_paths
from mlsm_manager.surface_map.map_file import Layer
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

RESOLUTION = 0.5
WIDTH = np.radians(2.5)
ORIGIN = np.array([0.25, 0.25, -2.0])


class Water:
    """A map with its free space, into which scans from one place are carved."""

    def __init__(self, **parameters):
        self.occupied, self.free = MultiLevelSurfaceMap(RESOLUTION), MultiLevelSurfaceMap(RESOLUTION)
        self._carver = Carver(CarvingParameters(**parameters), WIDTH)

    def scan(self, echoes, origin=ORIGIN):
        """Insert and carve a scan with one beam for each of the echoes [x, y, z]."""
        points = np.column_stack([np.array(echoes, dtype=np.float64), np.full(len(echoes), 50.0)])
        self.occupied.insert(points)
        origins = np.tile(origin, (len(points), 1))
        beams = FirstEchoes.of_points(points, np.arange(len(points)), origins)
        return self._carver.carve(self.occupied, self.free, beams, points)[0]

    def put(self, *place):
        """Put a block there that no scan saw."""
        self.occupied.insert(np.array([[*place, 50.0]]))

    def free_cells(self):
        """Return the cells known to be free, sorted."""
        return sorted(map(tuple, self.free.blocks.cells.tolist()))


def test_the_cells_between_sonar_and_echo_are_free_and_those_behind_are_not_known():
    water = Water()
    water.scan([[10.25, 0.25, -2.0]])
    cells = [cell for cell in water.free_cells() if cell[1] == 0]
    assert cells == [(x, 0) for x in range(19)]


def test_a_cell_is_free_at_the_height_of_the_beams_axis():
    water = Water()
    water.scan([[10.25, 0.25, -4.0]])
    blocks = water.free.blocks
    np.testing.assert_allclose(blocks.mean[:, 2], -2.0 - 0.2 * (blocks.mean[:, 0] - 0.25), atol=0.11)


def test_a_beam_is_as_wide_far_away_as_its_angle_says():
    water = Water()
    water.scan([[80.25, 0.25, -2.0]])
    rows = [y for x, y in water.free_cells() if x == 150]
    assert len(rows) * RESOLUTION == pytest.approx(75.0 * WIDTH, abs=2 * RESOLUTION)


def test_nothing_is_carved_behind_an_occupied_block():
    water = Water()
    water.put(5.25, 0.25, -2.0)
    water.scan([[20.25, 0.25, -2.0]])
    assert max(x for x, y in water.free_cells() if y == 0) == 9


def test_a_block_outside_the_inner_fan_is_neither_crossed_nor_in_the_way():
    water = Water()
    water.put(5.25, 0.25, -8.0)
    report = water.scan([[20.25, 0.25, -2.0]])
    assert (report.crossed, int(water.occupied.blocks.crossed.sum())) == (0, 0)
    assert max(x for x, y in water.free_cells() if y == 0) > 30


def test_a_block_that_beams_keep_crossing_goes():
    water = Water(crossings_least=5, crossings_per_point=1.0)
    water.put(5.25, 0.25, -2.0)
    removed = [water.scan([[20.25, 0.25, -2.0]]).removed for _ in range(8)]
    assert removed == [0, 0, 0, 0, 0, 0, 1, 0]
    assert water.occupied.blocks.mean[:, 0].tolist() == [20.25]
    assert max(x for x, y in water.free_cells() if y == 0) > 30


def test_the_surer_a_block_the_longer_it_stays():
    water = Water(crossings_least=5, crossings_per_point=1.0)
    for _ in range(10):
        water.put(5.25, 0.25, -2.0)
    assert sum(water.scan([[20.25, 0.25, -2.0]]).removed for _ in range(14)) == 0
    assert sum(water.scan([[20.25, 0.25, -2.0]]).removed for _ in range(2)) == 1


def test_a_block_that_is_heard_again_stays():
    water = Water(crossings_least=5, crossings_per_point=1.0)
    water.put(5.25, 0.25, -2.0)
    for _ in range(4):
        for _ in range(5):
            water.scan([[20.25, 0.25, -2.0]])
        water.put(5.25, 0.25, -2.0)
    assert sorted(water.occupied.blocks.mean[:, 0]) == [5.25, 20.25]


def test_a_scan_does_not_speak_against_what_it_hit_itself():
    water = Water(crossings_least=1, crossings_per_point=0.0)
    for _ in range(10):
        water.scan([[5.25, 0.25, -2.0], [20.25, 0.3, -2.0]])
    assert sorted(set(np.floor(water.occupied.blocks.mean[:, 0]))) == [5.0, 20.0]


def test_a_wall_stays_however_often_it_is_looked_at_along():
    water, rng = Water(), np.random.RandomState(0)
    for turn in range(40):
        x = np.arange(1.0, 40.0, 0.7)
        echoes = np.column_stack([x, np.full(len(x), 3.0), np.full(len(x), -2.0)]) + 0.1 * rng.randn(len(x), 3)
        water.scan(echoes, ORIGIN + np.array([0.3 * turn, 0.0, 0.0]))
    blocks = water.occupied.blocks
    heard = {tuple(cell) for cell in blocks.take(blocks.count > 3).cells.tolist()}
    assert len(heard) > 60


def test_only_the_nearest_echo_of_a_beam_counts():
    points = np.array([[9.0, 0, 0, 1], [5.0, 0, 0, 1], [7.0, 0, 0, 1]])
    beams = FirstEchoes.of_points(points, np.array([1.0, 1.0, 2.0]), np.zeros((3, 3)))
    assert beams.echoes[:, 0].tolist() == [5.0, 7.0]


def test_a_pair_of_beam_and_cell_is_found_once():
    echoes = np.array([[30.0, 0.3, 0.0], [30.0, 2.0, 0.0], [-12.0, 9.0, 0.0]])
    paths = beam_paths(FirstEchoes(np.zeros((3, 3)), echoes), WIDTH, RESOLUTION)
    pairs = set(zip(paths.beam.tolist(), map(tuple, paths.cells[paths.cell].tolist())))
    assert len(pairs) == len(paths.beam)
    assert paths.cell[paths.starts].tolist() == list(range(len(paths.cells)))


@pytest.mark.parametrize("echoes", [[], [[0.3, 0.2, -2.0]]])
def test_a_scan_without_echoes_or_with_near_ones_only_says_nothing(echoes):
    water = Water()
    report = water.scan(np.reshape(echoes, (-1, 3)))
    assert (report.free, report.crossed, report.removed) == (0, 0, 0)


SONAR_IN_BASE = (5.0, 0.0)
GHOST = np.array([[2.1, 5.1]])
"""An echo between the vehicle and the harbour's wall that is heard once."""


CARVED_SOON = {"crossings_least": 2, "crossings_per_point": 1.0, "free_scans": 2}


def localiser_of(estimator, map_input=MapInput.MATCHED, sonar_in_base=SONAR_IN_BASE, **changes):
    parameters = MlsmCoreParameters(estimator=estimator, map_input=map_input, **changes)
    return parameters.build_localiser(sonar_in_base)


def heard(turn):
    """Return a scan of the harbour, the first with the ghost."""
    return scan_of(np.vstack([harbour(), GHOST]) if turn == 0 else harbour(), still(), start=16.0 * turn)


@lru_cache(maxsize=None)
def layers_with_a_ghost(estimator, matching, carve):
    """Return the maps after a scan with the ghost and eight without it."""
    localiser = localiser_of(estimator, start_matching=matching, carve=carve, **CARVED_SOON)
    localiser.mount(np.zeros(2))
    for turn in range(9):
        localiser.take_scan(heard(turn))
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
    localiser = localiser_of(EstimatorName.THESIS, start_matching=matching)
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
    changes = {"start_matching": False, "carve": carve, **CARVED_SOON}
    localiser = localiser_of(estimator, MapInput.CLEANED, (0.0, 0.0), **changes)
    for turn in range(9):
        if turn < scans and not cloud_first:
            localiser.take_scan(heard(turn))
        localiser.take_cloud(MapCloud.of_scan(heard(turn)))
        if turn < scans and cloud_first:
            localiser.take_scan(heard(turn))
    return localiser
