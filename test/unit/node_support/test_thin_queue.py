"""A link of few bytes a second: nothing faster than it takes, the newest of each thing, the most urgent first."""

import numpy as np

from node_support.thin_queue import ThinQueue

RATE = 24000.0  # bytes a second: three quarters of 256 kbit/s


def sent_by(queue, start, end):
    return [one for now in np.arange(start, end, 0.25) for one in queue.take(now)]


def test_what_is_sent_fits_the_link():
    queue = ThinQueue(RATE)
    for tile in range(200):
        queue.put(tile, tile, 5000, 2)
    assert sum(one.size for one in sent_by(queue, 0.0, 20.0)) <= RATE * 21.0 + 5000


def test_fixes_overtake_tiles_and_a_tile_that_keeps_changing_keeps_its_turn():
    queue = ThinQueue(RATE)
    for key in ("first", "second", "first"):
        queue.put(key, f"newest {key}", 100, 2)
    queue.put("fix", "fix", 100, 0)
    assert [one.item for one in queue.take(0.0)] == ["fix", "newest first", "newest second"]


def test_a_map_that_every_scan_changes_is_whole_ten_seconds_after_each_change():
    """Scans of 12 s that change 30 tiles of 100 blocks each, beside fixes, diagnostics, a path and a picture."""
    queue = ThinQueue(RATE)
    for scan in range(20):
        for tile in range(30):
            queue.put(("tile", (scan * 7 + tile) % 90), "tile", 300 + 40 * 100, 2)
        queue.put("fix", "fix", 400, 0)
        for key in ("path", "image", *range(10)):
            queue.put(key, key, 10_000 if isinstance(key, str) else 2_000, 3)
        sent_by(queue, 12.0 * scan, 12.0 * scan + 10.0)
        assert not any(key[0] == "tile" for key in queue._waiting if isinstance(key, tuple))


def test_what_is_dropped_is_not_sent():
    queue = ThinQueue(RATE)
    queue.put("old map", "old map", 100, 2)
    queue.drop(["old map", "unknown"])
    assert (queue.take(0.0), queue.waiting_bytes) == ([], 0)
