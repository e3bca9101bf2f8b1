"""What a map keeps its blocks in: the hash table of cells, and copies that are made in pieces."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_maps import map_with

from mlsm_manager.surface_map import block_store
from mlsm_manager.surface_map.block_store import NO_BLOCK, CellIndex, finished
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import cell_keys

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


@pytest.mark.parametrize("at_once", [1000, 200_000])
def test_a_table_that_grows_loses_nothing(at_once):
    rng = np.random.RandomState(3)
    keys = np.unique(_keys(rng.randint(-(2**31) + 1, 2**31 - 1, (200_000, 2), dtype=np.int64)))
    rng.shuffle(keys)
    index = CellIndex(0)
    for start in range(0, len(keys), at_once):
        part = keys[start : start + at_once]
        slots = index.slots(part)
        index.heads[slots] = np.arange(start, start + len(part))
    assert index.find(keys).tolist() == list(range(len(keys)))


@given(st.lists(CELLS, unique=True, max_size=60))
def test_different_cells_have_different_keys_that_sort_by_x_then_y(cells):
    keys = _keys(sorted(cells))
    assert (keys[1:] > keys[:-1]).all()


@pytest.mark.parametrize(
    ("expected", "cells"),
    [
        pytest.param(0, [[(x, -x)] for x in range(600)], id="crowded, but not full"),
        pytest.param(14400, [[(x, y) for x in range(120) for y in range(120)]], id="as many as expected"),
        pytest.param(0, [[(x, 0) for x in range(10)]] * 200, id="known already"),
    ],
)
def test_a_table_does_not_grow_before_it_must(expected, cells):
    index = CellIndex(expected)
    before = len(index.heads)
    for part in cells:
        index.slots(_keys(part))
    assert len(index.heads) == before


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    monkeypatch.setattr(block_store, "_PIECE", 7)


def map_of(seed, count=60):
    return map_with(np.random.RandomState(seed).uniform(-4.0, 4.0, (count, 4)))


def changed(surface_map, rng):
    """Insert points into old blocks and new cells, take blocks away, and count crossings."""
    surface_map.insert(rng.uniform(-5.0, 5.0, (20, 4)))
    _, rows, _ = surface_map.find(surface_map.blocks.keys[:5])
    surface_map.remove(np.unique(rows))
    _, rows, _ = surface_map.find(surface_map.blocks.keys[-5:])
    rows = np.unique(rows)
    surface_map.count_crossings(rows, np.ones(len(rows), dtype=np.uint16))


@given(seed=st.integers(0, 2**31), steps=st.integers(0, 6))
def test_changes_between_two_pieces_are_not_in_the_copy(seed, steps):
    surface_map, rng = map_of(seed), np.random.RandomState(seed)
    before, copy = surface_map.blocks, surface_map.begin_copy()
    for _ in range(steps):
        copy.step()
        changed(surface_map, rng)
    blocks = finished(copy, threading.RLock())
    np.testing.assert_array_equal(blocks.rows, before.rows)
    np.testing.assert_array_equal(blocks.crossed, before.crossed)


def test_the_map_that_changed_meanwhile_has_its_changes():
    copied, other = map_of(1), map_of(1)
    copy = copied.begin_copy()
    for surface_map in (copied, other):
        changed(surface_map, np.random.RandomState(2))
    finished(copy, threading.RLock())
    np.testing.assert_array_equal(copied.blocks.rows, other.blocks.rows)


def test_two_copies_at_the_same_time_are_each_as_old_as_they_are():
    surface_map, rng = map_of(3), np.random.RandomState(4)
    wanted, copies = [], []
    for _ in range(2):
        wanted.append(surface_map.blocks)
        copies.append(surface_map.begin_copy())
        changed(surface_map, rng)
    for copy, blocks in zip(copies, wanted):
        np.testing.assert_array_equal(finished(copy, threading.RLock()).rows, blocks.rows)


def test_an_empty_map_has_an_empty_copy():
    assert len(finished(MultiLevelSurfaceMap(0.5).begin_copy(), threading.RLock())) == 0


def test_the_lock_is_free_between_two_pieces():
    """Somebody who waits for it changes the map before the copy is complete."""
    surface_map, lock = map_of(5, count=4000), threading.RLock()
    before, copy, seen = surface_map.blocks, surface_map.begin_copy(), []
    wants_the_lock = threading.Event()

    def change():
        wants_the_lock.set()
        with lock:
            surface_map.insert(np.zeros((1, 4)))
            seen.append(copy.is_complete)

    lock.acquire()
    changing = threading.Thread(target=change)
    changing.start()
    wants_the_lock.wait()
    copy.step()
    lock.release()
    copied = finished(copy, lock)
    changing.join()
    assert seen == [False]
    np.testing.assert_array_equal(copied.rows, before.rows)
