"""A copy of a map that is made in pieces is the map as it was when the copy began."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsm_manager.surface_map import block_store
from mlsm_manager.surface_map.block_store import finished
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    monkeypatch.setattr(block_store, "_PIECE", 7)


def map_of(seed, count=60):
    surface_map = MultiLevelSurfaceMap(0.5)
    surface_map.insert(np.random.RandomState(seed).uniform(-4.0, 4.0, (count, 4)))
    return surface_map


def changed(surface_map, rng):
    """Insert points into old blocks and new cells, take blocks away, and count crossings."""
    surface_map.insert(rng.uniform(-5.0, 5.0, (20, 4)))
    _, rows, _ = surface_map.find(surface_map.blocks.cells[:5])
    surface_map.remove(np.unique(rows))
    _, rows, _ = surface_map.find(surface_map.blocks.cells[-5:])
    rows = np.unique(rows)
    surface_map.count_crossings(rows, np.ones(len(rows), dtype=np.uint16))


@settings(max_examples=30, deadline=None)
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
