"""What the map promises, with whatever points, and the point-by-point rule of thesis 6.2 and 6.5.6 that it follows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_maps import in_order, map_with, partition, random_map

from mlsm_manager.surface_map import block_store, insertion
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.insertion import InsertReport
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import cell_keys, cells_of


def _grid(side, z, place=0.0):
    x, y = np.divmod(np.arange(side * side), side)
    return np.column_stack([place + x + 0.25, y + 0.25, np.full(x.size, z), np.ones(x.size)])


def test_a_cell_holds_its_lower_border_and_not_its_upper():
    blocks = map_with([[0.5, 1.0, 0, 1], [np.nextafter(0.5, 0), np.nextafter(1.0, 0), 0, 1]]).blocks
    assert sorted(blocks.cells.tolist()) == [[0, 1], [1, 2]]


@pytest.mark.parametrize("resolution", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("batches", [1, 7])
def test_points_on_a_border_stay_in_their_cell_when_their_mean_is_taken(resolution, batches):
    borders = np.arange(-40, 41) * resolution
    points = np.column_stack([borders, borders, np.zeros(81), np.ones(81)])
    mlsm = map_with(np.tile(points, (7, 1)), resolution, batches)
    expected = {tuple(cell) for cell in cells_of(points, resolution).tolist()}
    assert {tuple(cell) for cell in mlsm.blocks.cells.tolist()} == expected


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_point_that_is_not_finite_is_counted_and_left_out(column, value):
    points = np.array([[0.1, 0.1, 0, 1], [0.1, 0.1, 0, 1]], dtype=np.float32)
    points[1, column] = value
    mlsm = MultiLevelSurfaceMap(0.5)
    assert mlsm.insert(points) == InsertReport(inserted=1, outside=0)
    assert mlsm.blocks.count.tolist() == [1]


@pytest.mark.parametrize("column", range(3))
@pytest.mark.parametrize("value", [-100.5, 100.5, 1e6, -1e30])
def test_a_point_beyond_the_limit_is_counted_and_left_out(column, value):
    points = np.ones((2, 4))
    points[1, column] = value
    mlsm = MultiLevelSurfaceMap(0.5, limit=100.0)
    assert mlsm.insert(points) == InsertReport(inserted=1, outside=1)
    assert len(mlsm) == 1


def test_the_smallest_cells_reach_the_widest_limit():
    corners = np.array([[x, y, 0.0, 1.0] for x in (-1e6, 1e6) for y in (-1e6, 1e6)])
    blocks = map_with(corners, resolution=0.01, limit=1e6).blocks
    assert sorted(blocks.cells.tolist()) == [[x, y] for x in (-(10**8), 10**8) for y in (-(10**8), 10**8)]


def test_the_map_grows_beyond_its_first_capacity_and_forgets_nothing():
    points = _grid(120, 0.0)
    mean = map_with(points, batches=9).blocks.mean
    assert mean[np.lexsort((mean[:, 1], mean[:, 0]))].tolist() == points.tolist()


def test_a_cell_holds_thousands_of_blocks():
    column = np.column_stack([np.zeros((3000, 2)), np.arange(3000.0), np.ones(3000)])
    mlsm = map_with(column)
    column[:, 2] += 0.1
    mlsm.insert(column)
    assert mlsm.blocks.count.tolist() == [2] * 3000


def test_rows_freed_by_fusing_are_used_again():
    mlsm = MultiLevelSurfaceMap(0.5, expected_blocks=1024)
    for z in (0.0, 0.8, 0.4):
        mlsm.insert(_grid(17, z))
    assert len(mlsm) == 289
    before = mlsm.nbytes
    mlsm.insert(_grid(17, 0.0, place=100.0))
    assert mlsm.nbytes == before
    assert sorted(mlsm.blocks.count.tolist()) == [1] * 289 + [3] * 289


def test_a_full_map_takes_at_most_120_bytes_per_block():
    x, y = np.divmod(np.arange(2**17), 512)
    mlsm = map_with(np.column_stack([x, y, np.zeros(2**17), np.ones(2**17)]), batches=16)
    assert len(mlsm) == 2**17
    assert mlsm.nbytes / len(mlsm) <= 120.0


def test_a_snapshot_does_not_change_with_the_map():
    mlsm = map_with([[0, 0, 0, 1]])
    blocks = mlsm.blocks
    mlsm.insert(np.array([[0, 0, 0.1, 1]]))
    assert blocks.count.tolist() == [1]


@pytest.mark.parametrize("writeable", [True, False])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_no_loop_is_compiled_after_the_map_was_made(dtype, writeable):
    surface_map = MultiLevelSurfaceMap(0.5)
    loops = [loop for module in (block_store, insertion) for loop in vars(module).values()]
    loops = [loop for loop in loops if hasattr(loop, "signatures")]
    compiled = [len(loop.signatures) for loop in loops]
    points = np.zeros((3, 4), dtype)
    points.setflags(write=writeable)
    surface_map.insert(points)
    surface_map.insert_blocks(surface_map.blocks)
    surface_map.remove(surface_map.find(surface_map.blocks.keys)[1])
    assert len(loops) >= 3
    assert [len(loop.signatures) for loop in loops] == compiled


def test_blocks_that_overlap_among_themselves_become_one():
    tall, inner = (map_with([[0.1, 0.1, z, 1.0] for z in heights]) for heights in ((0.0, 0.4, 0.8, 1.2), (0.1, 1.0)))
    merged = MultiLevelSurfaceMap(0.5)
    merged.insert_blocks(Blocks.joined([tall.blocks, inner.blocks]))
    assert partition(merged.blocks) == [((0, 0), 0.0, 1.2, 6, 1)]


def test_inserted_blocks_keep_their_crossings_and_end_those_of_what_they_meet():
    surface_map, other = MultiLevelSurfaceMap(0.5), MultiLevelSurfaceMap(0.5)
    for one, place, crossings in ((surface_map, 0.1, 9), (other, 0.1, 3), (other, 5.1, 4)):
        one.insert(np.array([[place, 0.1, 0.0, 1.0]]))
        _, rows, _ = one.find(cell_keys(np.array([[int(place / 0.5), 0]])))
        one.count_crossings(rows, np.array([crossings]))
    surface_map.insert_blocks(other.blocks)
    assert surface_map.blocks.crossed.tolist() == [3, 4]


def test_blocks_of_another_resolution_are_refused():
    with pytest.raises(ValueError, match=r"resolution 0\.25 m: must be the map's, 0\.5 m"):
        MultiLevelSurfaceMap(0.5).insert_blocks(random_map(resolution=0.25).blocks)


def test_blocks_beyond_the_limit_are_left_out():
    surface_map = MultiLevelSurfaceMap(0.5, limit=5.0)
    blocks = random_map(count=500).blocks
    surface_map.insert_blocks(blocks)
    inside = np.abs(blocks.rows[:, [0, 1, 9, 10]]).max(axis=1) <= 5.0
    assert 0 < inside.sum() < len(blocks)
    assert partition(surface_map.blocks) == partition(blocks.take(inside))


@given(st.integers(0, 2**31), st.lists(st.floats(-12, 12), min_size=4, max_size=4))
def test_a_box_holds_the_blocks_that_a_look_at_all_finds_in_the_same_order(seed, corners):
    low, high = np.minimum(corners[:2], corners[2:]), np.maximum(corners[:2], corners[2:])
    surface_map = random_map(seed, count=1500)
    assert surface_map.in_box(low, high).rows.tolist() == surface_map.blocks.in_box(low, high).rows.tolist()


def test_a_box_may_be_bounded_in_height():
    surface_map = random_map()
    low, high = np.array([-5.0, -5.0, -1.0]), np.array([5.0, 5.0, 1.0])
    found = surface_map.in_box(low, high)
    assert 0 < len(found) < len(surface_map.in_box(low[:2], high[:2]))
    assert ((found.mean[:, 2] >= -1.0) & (found.mean[:, 2] <= 1.0)).all()


def test_only_tiles_that_changed_are_told_and_only_once():
    surface_map = map_with([[0.1, 0.1, 0, 1], [-0.1, 20.0, 0, 1]])
    assert surface_map.take_changed_tiles().tolist() == [[-1, 2], [0, 0]]
    assert surface_map.take_changed_tiles().tolist() == []
    surface_map.insert(np.array([[0.1, 0.1, 9, 1]]))
    assert surface_map.take_changed_tiles().tolist() == [[0, 0]]


def test_the_tiles_together_hold_the_map():
    surface_map = random_map(extent=40.0)
    tiles = surface_map.take_changed_tiles()
    assert len(tiles) > 4
    rows = np.concatenate([surface_map.in_tiles(part).rows for part in np.array_split(tiles, 3)])
    assert sorted(rows.tolist()) == sorted(surface_map.blocks.rows.tolist())


def test_tiles_that_nobody_asks_for_do_not_pile_up():
    surface_map = MultiLevelSurfaceMap(0.5)
    for place in range(200):
        surface_map.insert(np.array([[place % 7 * 8.0, 0.0, 0.0, 1.0]]))
    assert len(surface_map.take_changed_tiles()) == 7


RESOLUTIONS = st.sampled_from([0.1, 0.25, 0.3, 0.5, 1.0])
BATCHES = st.integers(1, 6)
STRENGTH = st.integers(0, 127)


def _literal_blocks(points, resolution):
    """Return (cell, bottom, height, points) of all blocks, sorted, as thesis 6.5.6 makes them point by point.

    Two departures: a block keeps its bottom instead of its depth, because height - depth rounds, and its points, of
    whose variance equation 6.6 gives a part only.
    """
    cells = {}
    for point in points:
        z, cell = point[2], tuple(np.floor(point[:2] / resolution).astype(int))
        joined, apart = (z, z, [point]), []
        for bottom, height, held in cells.get(cell, []):
            if abs(z - height) < resolution or abs(bottom - z) < resolution or bottom < z < height:
                joined = (min(joined[0], bottom), max(joined[1], height), held + joined[2])
            else:
                apart.append((bottom, height, held))
        cells[cell] = [*apart, joined]
    blocks = [(cell, *block) for cell, held in cells.items() for block in held]
    return sorted(blocks, key=lambda block: block[:2])


def assert_follows_the_literal_rule(points, resolution, batches=1):
    """Compare a map built in batches with one built point by point."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 4)
    expected = _literal_blocks(points, resolution)
    blocks = map_with(points, resolution, batches).blocks
    assert partition(blocks) == [
        (cell, bottom, height, len(held), int(height - bottom >= resolution)) for cell, bottom, height, held in expected
    ]
    scale = max(np.abs(points).max(initial=1.0), 1.0)
    for row, (*_, held) in zip(in_order(blocks), expected):
        np.testing.assert_allclose(blocks.mean[row], np.mean(held, axis=0), rtol=1e-12, atol=1e-12 * scale)
        np.testing.assert_allclose(blocks.variance[row], np.var(held, axis=0), rtol=1e-9, atol=1e-13 * scale**2)


def _coordinates(values):
    return st.lists(st.tuples(values, values, values, STRENGTH), max_size=40)


def _on_lattice(points, spacing):
    return [(x * spacing, y * spacing, z * spacing, strength) for x, y, z, strength in points]


@given(_coordinates(st.floats(-1.5, 1.5)), st.sampled_from([-9000.0, 0.0, 9000.0]), RESOLUTIONS, BATCHES)
def test_random_points_at_the_origin_and_far_from_it(points, shift, resolution, batches):
    moved = [(x + shift, y - shift, z, strength) for x, y, z, strength in points]
    assert_follows_the_literal_rule(moved, resolution, batches)


@pytest.mark.parametrize("fraction", [1.0, 0.5, 1.0 / 3.0])
@given(_coordinates(st.integers(-3, 3)), RESOLUTIONS, BATCHES)
def test_lattices_whose_gaps_are_the_resolution_or_a_part_of_it(fraction, points, resolution, batches):
    assert_follows_the_literal_rule(_on_lattice(points, resolution * fraction), resolution, batches)


@pytest.mark.parametrize("batches", [1, 7, 1000])
def test_a_scan_of_many_points(batches):
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.normal(0.0, 2.0, (1000, 2)), rng.normal(0.0, 4.0, 1000), rng.uniform(0, 127, 1000)])
    assert_follows_the_literal_rule(points, 0.5, batches)


@given(st.data(), _coordinates(st.integers(-2, 2)), RESOLUTIONS)
def test_the_order_of_the_points_changes_nothing(data, points, resolution):
    lattice = _on_lattice(points, resolution * 0.5)
    shuffled = data.draw(st.permutations(lattice))
    maps = [map_with(order, resolution, 3).blocks for order in (lattice, shuffled)]
    assert partition(maps[0]) == partition(maps[1])


@pytest.mark.parametrize(("gap", "counts"), [(0.5, [1, 1]), (np.nextafter(0.5, 0.0), [2])])
def test_a_gap_of_the_resolution_separates_and_a_little_less_does_not(gap, counts):
    assert map_with([[0, 0, 0.0, 1], [0, 0, gap, 1]]).blocks.count.tolist() == counts
