"""Free space: what beams crossed before their first echo, and what that says against blocks."""

import numpy as np
import pytest

from mlsm_manager.surface_map.free_space import Carver, CarvingParameters, FirstEchoes, beam_paths
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
        return self._carver.carve(self.occupied, self.free, beams, points)

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
