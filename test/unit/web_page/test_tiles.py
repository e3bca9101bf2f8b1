"""Only tiles that changed are told, and each cell carries since when it is known."""

import struct

import numpy as np
import pytest

from web_page.tiles import BORN_STEP, SIDE, MapTiles

WALL = np.array([[0.1, 0.1], [0.6, 0.1], [-0.4, 0.1], [40.2, -3.0]])
COUNTS = np.array([1.0, 10.0, 100.0, 5.0])


class _Tiles(MapTiles):
    def __init__(self):
        self.told = {}
        super().__init__(self.told.__setitem__)


@pytest.fixture
def tiles():
    return _Tiles()


def _cells(data):
    """Return (index, born, level) of a tile's bytes."""
    _, _, count, _, _ = struct.unpack_from("<BBHhh", data)
    index, born = np.frombuffer(data, "<u2", 2 * count, 8).reshape(2, -1)
    return index, born, np.frombuffer(data, "u1", count, 8 + 4 * count)


def test_cells_lie_in_the_tile_of_their_place_also_left_of_the_origin(tiles):
    tiles.take(WALL, COUNTS, 0.5, 0.0)
    assert set(tiles.told) == {(0, 0), (-1, 0), (2, -1)}
    assert _cells(tiles.told[0, 0])[0].tolist() == [0, 1]
    assert _cells(tiles.told[-1, 0])[0].tolist() == [SIDE - 1]


def test_more_points_make_a_higher_level(tiles):
    tiles.take(WALL, COUNTS, 0.5, 0.0)
    few, more = _cells(tiles.told[0, 0])[2]
    assert few < more


def test_a_cell_keeps_the_time_at_which_it_was_first_seen(tiles):
    tiles.take(WALL[:1], COUNTS[:1], 0.5, 0.0)
    tiles.take(WALL[:2], COUNTS[:2], 0.5, 10.0)
    assert _cells(tiles.told[0, 0])[1].tolist() == [0, 10.0 / BORN_STEP]


def test_a_tile_that_lost_all_its_cells_is_told_as_empty(tiles):
    tiles.take(WALL, COUNTS, 0.5, 0.0)
    tiles.take(WALL[:3], COUNTS[:3], 0.5, 1.0)
    assert len(_cells(tiles.told[2, -1])[0]) == 0
    tiles.take(np.empty((0, 2)), np.empty(0), 0.5, 2.0)
    assert all(len(_cells(data)[0]) == 0 for data in tiles.told.values())


def test_points_that_no_map_has_are_left_out(tiles):
    odd = np.array([[np.nan, 0.0], [np.inf, 0.0], [1e12, 0.0], [1.0, 1.0]])
    tiles.take(odd, np.array([1.0, 1.0, 1.0, 0.0]), 0.5, 0.0)
    assert tiles.cells == 0
