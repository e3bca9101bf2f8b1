"""What a run settled in a map moves with its path when a loop bends it."""

from dataclasses import dataclass

import numpy as np
import test_keyframes
from test_keyframes import CARVER, LIMIT, RESOLUTION, cloud, made_at_once, patch

from mlsm_manager.localisation import keyframe_traces
from mlsm_manager.localisation.keyframe_map import KeyframeMap
from mlsm_manager.localisation.keyframe_traces import Stretches
from mlsm_manager.scan_matching.scan import MapCloud
from mlsm_manager.surface_map.insertion import _merged_runs

EVERYTHING = 1e9


@dataclass(frozen=True)
class Bent:
    """A path along which clouds move by `shift` m along y from second `since` on."""

    shift: float
    since: float = 0.0

    def path(self, times):
        return np.column_stack([times, np.where(times >= self.since, self.shift, 0.0), np.zeros(len(times))])

    def points(self, cloud):
        return self.heard(cloud)[0]

    def heard(self, cloud):
        """Return the points (n, 4) in map, and where the sonar was (n, 2)."""
        (x, y, _), count = self.path(np.array([cloud.end]))[0], len(cloud)
        return cloud.points + np.array([0.0, y, 0.0, 0.0]), np.tile([x, y], (count, 1))


def assert_same(found, wanted):
    """Compare blocks, which are kept with the precision of float32."""
    test_keyframes.assert_same(found, wanted, within=1e-3)


def settled(*clouds, carver=None):
    made = KeyframeMap(RESOLUTION, LIMIT, carver=carver, stretches=Stretches(RESOLUTION))
    for keyframe in clouds:
        made.add(keyframe)
        made.draw(Bent(0.0), EVERYTHING)
    return made


def test_settled_keyframes_move_with_their_part_of_the_path():
    made, bent = settled(patch(1), patch(2), patch(3)), Bent(8.0, since=2.0)
    made.redraw(bent)
    assert_same(made.map.blocks, made_at_once(*(bent.points(patch(number)) for number in (1, 2, 3))))


def test_they_move_again_with_the_next_loop():
    made = settled(patch(1), patch(2))
    made.redraw(Bent(8.0))
    made.redraw(Bent(2.0))
    assert_same(made.map.blocks, made_at_once(*(Bent(2.0).points(patch(number)) for number in (1, 2))))


def test_keyframes_that_may_still_move_are_drawn_where_they_are():
    made, bent = settled(patch(1)), Bent(8.0)
    made.add(patch(2))
    made.draw(Bent(0.0), 1.0)
    made.redraw(bent)
    assert_same(made.map.blocks, made_at_once(bent.points(patch(1)), bent.points(patch(2))))


def test_points_of_no_keyframe_are_not_lost():
    made = settled(patch(1))
    made.insert(patch(2).points)
    made.redraw(Bent(0.0))
    assert_same(made.map.blocks, made_at_once(patch(1).points, patch(2).points))


def test_many_stretches_become_fewer_and_stay_in_the_map(monkeypatch):
    monkeypatch.setattr(keyframe_traces, "_MOST", 3)
    made, bent = settled(*(patch(number) for number in range(6))), Bent(4.0)
    made.redraw(bent)
    assert_same(made.map.blocks, made_at_once(*(bent.points(patch(number)) for number in range(6))))


def test_a_place_that_is_passed_for_hours_takes_no_more_memory_and_the_newest_path_still_bends(monkeypatch):
    monkeypatch.setattr(keyframe_traces, "_FEWEST_BLOCKS", 0)
    points, own = patch(1).points, Stretches(RESOLUTION)
    made = KeyframeMap(RESOLUTION, LIMIT, stretches=own)
    for number in range(60):
        made.add(MapCloud(points, np.full(len(points), float(number)), float(number)))
        made.draw(Bent(0.0), EVERYTHING)
    assert own.block_count <= 5 * len(made.map)
    made.redraw(Bent(8.0, since=59.0))
    there = made_at_once(points, Bent(8.0).points(patch(1)))
    np.testing.assert_array_equal(np.unique(made.map.blocks.cells, axis=0), np.unique(there.cells, axis=0))


def test_what_beams_carved_away_does_not_come_back():
    gone, behind = (10.25, 0.25), (20.25, 0.25)
    clouds = [cloud(number, behind) for number in range(1, 12)]
    made = settled(cloud(0, gone), *clouds, carver=CARVER)
    assert len(made.map) == 1
    made.redraw(Bent(0.0))
    assert len(made.map) == 1


def test_free_space_moves_too():
    made = settled(cloud(1, (10.25, 0.25)), carver=CARVER)
    before = made.free.blocks.mean[:, :2]
    made.redraw(Bent(8.0))
    np.testing.assert_allclose(np.sort(made.free.blocks.mean[:, 1]), np.sort(before[:, 1]) + 8.0)


def test_a_map_is_drawn_anew_by_the_loops_that_are_compiled_for_every_map():
    """Loops for single precision, in which stretches are kept, would be compiled for seconds when a loop closes."""
    settled(patch(1)).redraw(Bent(8.0))
    assert {rows.dtype.name for (rows, *_), *_ in _merged_runs.signatures} == {"float64"}
