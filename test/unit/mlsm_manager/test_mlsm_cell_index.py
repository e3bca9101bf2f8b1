"""The hash table of cells against a dict."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mlsm_manager.surface_map.cell_index import NO_BLOCK, CellIndex, cell_keys

CLUSTERED = st.integers(-40, 40)
FAR = st.sampled_from([-(10**8), -(2**31) + 1, -65536, -1, 0, 1, 65536, 10**8, 2**31 - 1])
CELLS = st.one_of(st.tuples(CLUSTERED, CLUSTERED), st.tuples(FAR, FAR), st.tuples(CLUSTERED, FAR))


def _keys(cells):
    return cell_keys(np.array(cells, dtype=np.int64).reshape(-1, 2))


@given(st.lists(st.lists(CELLS, unique=True, max_size=60), max_size=8))
def test_it_finds_what_a_dict_finds(batches):
    index, expected = CellIndex(0), {}
    for batch in batches:
        slots = index.slots(_keys(batch))
        assert index.heads[slots].tolist() == [expected.get(cell, NO_BLOCK) for cell in batch]
        numbers = np.arange(len(batch)) + len(expected)
        index.heads[slots] = numbers
        expected.update(zip(batch, numbers.tolist()))


def test_it_grows_and_still_finds_every_cell():
    cells = [(x, y) for x in range(-60, 60) for y in range(-60, 60)]
    index = CellIndex(0)
    for start in range(0, len(cells), 100):
        slots = index.slots(_keys(cells[start : start + 100]))
        index.heads[slots] = np.arange(start, start + 100)
    slots = index.slots(_keys(cells))
    assert index.heads[slots].tolist() == list(range(len(cells)))


def test_a_large_table_grows_in_pieces_and_loses_nothing():
    rng = np.random.RandomState(3)
    keys = np.unique(_keys(rng.randint(-(2**31) + 1, 2**31 - 1, (200_000, 2), dtype=np.int64)))
    rng.shuffle(keys)
    index, sizes = CellIndex(0), []
    for start in range(0, len(keys), 1000):
        part = keys[start : start + 1000]
        slots = index.slots(part)
        index.heads[slots] = np.arange(start, start + len(part))
        sizes.append(index.nbytes)
    assert index.find(keys).tolist() == list(range(len(keys)))
    growth = np.diff(sizes) / sizes[:-1]
    assert growth[100:].max() < 0.1


def test_a_table_that_takes_many_cells_at_once_finds_them_all():
    keys = _keys([(x, y) for x in range(300) for y in range(300)])
    index = CellIndex(0)
    slots = index.slots(keys)
    index.heads[slots] = np.arange(len(keys))
    assert index.find(keys).tolist() == list(range(len(keys)))


def test_cells_have_slots_of_their_own():
    slots = CellIndex(0).slots(_keys([(x * 1024, y * 1024) for x in range(50) for y in range(50)]))
    assert len(set(slots.tolist())) == 2500


@given(st.lists(CELLS, unique=True, max_size=60))
def test_different_cells_have_different_keys_that_sort_by_x_then_y(cells):
    keys = _keys(sorted(cells))
    assert (keys[1:] > keys[:-1]).all()


def test_no_cells_need_no_slots():
    assert CellIndex(0).slots(_keys([])).tolist() == []


def test_a_crowded_table_does_not_grow_before_it_must():
    index = CellIndex(0)
    before = index.nbytes
    for x in range(600):
        index.slots(_keys([(x, -x)]))
    assert index.nbytes == before


def test_an_expected_number_of_cells_is_reserved_at_once():
    index = CellIndex(14400)
    before = index.nbytes
    index.slots(_keys([(x, y) for x in range(120) for y in range(120)]))
    assert index.nbytes == before


def test_known_cells_take_no_more_memory():
    index = CellIndex(0)
    keys = _keys([(x, 0) for x in range(10)])
    index.slots(keys)
    before = index.nbytes
    for _ in range(200):
        index.slots(keys)
    assert index.nbytes == before
