"""Ways that a vehicle may have gone: drawn, led to echoes that stand alone, weighed and drawn anew."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsm_manager.joint_solver.measured.odometry_timeline import OdometryTimeline
from mlsm_manager.joint_solver.motion.heading_factors import AHEAD, ASIDE
from mlsm_manager.joint_solver.motion.odometry_motion import Motion
from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.joint_solver.ways.way_comparisons import nats_of, nearby_of
from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.joint_solver.ways.way_motion import drawn, led
from mlsm_manager.joint_solver.ways.way_nodes import on_path
from mlsm_manager.joint_solver.ways.way_pulls import pulled, pulls_of
from mlsm_manager.joint_solver.ways.way_weighing import groups_of, weighed
from mlsm_manager.joint_solver.ways.ways import Ways, begun
from mlsm_manager.scan_matching.scan import Track

PART = 5.0  # s


def ways_of(seed, count=40, nodes=4):
    rng = np.random.RandomState(seed)
    return Ways(rng.normal(0.0, 2.0, (count, nodes, 2)), rng.normal(0.0, 0.3, (count, 2)), rng.normal(size=count))


def echoes_of(rng, node, count):
    normals = rng.normal(size=(count, 2))
    return WayEchoes(
        nodes=np.sort(rng.choice(node, count)), arms=rng.normal(0.0, 5.0, (count, 2)), shares=rng.uniform(0, 1, count),
        normals=normals / np.hypot(*normals.T)[:, np.newaxis], nats=rng.uniform(0.1, 3.0, count),
        lone=rng.rand(count) < 0.3,
    )  # fmt: skip


def post(node, arm, share=0.5):
    """Return one echo that stands alone."""
    return WayEchoes(
        nodes=np.array([node]), arms=np.array([arm]), shares=np.array([share]), normals=np.array([[1.0, 0.0]]),
        nats=np.array([3.0]), lone=np.array([True]),
    )  # fmt: skip


@given(st.integers(0, 10**6), st.integers(1, 30), st.integers(1, 60))
@settings(max_examples=30, deadline=None)
def test_the_compiled_loop_weighs_ways_as_numpy_does(seed, sources, targets):
    pytest.importorskip("numba")
    rng, ways = np.random.RandomState(seed), ways_of(seed, count=100)
    heard, earlier = echoes_of(rng, [7], sources), echoes_of(rng, [0, 1], targets)
    one, other = (nats_of(ways, heard, earlier, kernel) for kernel in (SolverKernel.NUMPY, SolverKernel.NUMBA))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


@given(st.integers(0, 10**6), st.integers(1, 30), st.integers(1, 60))
@settings(max_examples=30, deadline=None)
def test_the_compiled_loop_pulls_ways_as_numpy_does(seed, sources, targets):
    pytest.importorskip("numba")
    rng, ways = np.random.RandomState(seed), ways_of(seed)
    heard, earlier = echoes_of(rng, [7], sources), echoes_of(rng, [0, 1], targets)
    nearby = nearby_of(ways, heard, earlier)
    one, other = (pulls_of(ways, heard, nearby, kernel) for kernel in (SolverKernel.NUMPY, SolverKernel.NUMBA))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


def test_an_echo_that_stands_alone_pulls_a_way_towards_an_earlier_one():
    ways, heard = Ways(np.zeros((1, 3, 2)), np.zeros((1, 2)), np.zeros(1)), post(1, [5.0, 0.0], 1.0)
    nearby = nearby_of(ways, heard, post(0, [5.5, 0.5]))
    move = pulls_of(ways, heard, nearby, SolverKernel.NUMPY)[0]
    assert 0.2 < move[0] < 0.5
    assert move[0] == pytest.approx(move[1])


def test_a_wall_pulls_a_way_across_itself_only():
    ways = Ways(np.zeros((1, 3, 2)), np.zeros((1, 2)), np.zeros(1))
    heard, wall = (replace(echo, lone=np.array([False])) for echo in (post(1, [5.0, 0.0]), post(0, [5.5, 1.0])))
    move = pulls_of(ways, heard, nearby_of(ways, heard, wall), SolverKernel.NUMPY)[0]
    assert 0.1 < move[0] < 1.0
    assert move[1] == 0.0


def test_some_ways_are_pulled_and_their_speeds_with_them():
    ways = Ways(np.zeros((400, 3, 2)), np.zeros((400, 2)), np.zeros(400))
    heard = post(1, [5.0, 0.0], 1.0)
    nearby, rng = nearby_of(ways, heard, post(0, [6.0, 0.0])), np.random.RandomState(0)
    moved = pulled(ways, heard, nearby, PART, SolverKernel.NUMPY, rng)
    assert 100 < (moved.paths[:, -1, 0] > 0.0).sum() < 300
    np.testing.assert_allclose(moved.speeds, moved.paths[:, -1] / PART)


def test_few_ways_far_from_all_others_are_compared_with_what_they_heard_there():
    paths = np.zeros((1000, 3, 2))
    paths[:3, -1] = [60.0, 0.0]
    ways = Ways(paths, np.zeros((1000, 2)), np.zeros(1000))
    heard, earlier = post(1, [-30.0, 0.0], 1.0), post(0, [30.0, 0.0])
    nats = weighed(ways, heard, earlier, PART, SolverKernel.NUMPY, np.random.RandomState(0)).nats
    np.testing.assert_allclose(nats[:3], 0.0)
    assert nats[3:].max() < -2.0


def test_ways_that_end_in_one_square_are_one_group():
    groups = groups_of(np.array([[1.0, 1.0], [50.0, 1.0], [2.0, 1.5], [51.0, 2.0], [1.0, 50.0]]))
    assert sorted(sorted(group.tolist()) for group in groups) == [[0, 2], [1, 3], [4]]


def test_a_way_on_which_an_echo_lies_on_an_earlier_one_is_worth_that_echo():
    ways = Ways(np.array([[[0.0, 0.0]] * 3, [[0.0, 0.0], [0.0, 0.0], [9.0, 0.0]]]), np.zeros((2, 2)), np.zeros(2))
    nats = nats_of(ways, post(1, [5.0, 0.0]), post(0, [5.0, 0.0]), SolverKernel.NUMPY)
    np.testing.assert_allclose(nats, [3.0, 0.0], atol=0.01)


def test_a_surface_tells_nothing_to_one_that_faces_the_other_way():
    ways = Ways(np.zeros((1, 3, 2)), np.zeros((1, 2)), np.zeros(1))
    wall = replace(post(0, [5.0, 0.0]), lone=np.array([False]))
    behind = replace(wall, nodes=np.array([1]), normals=-wall.normals)
    assert nats_of(ways, behind, wall, SolverKernel.NUMPY) == 0.0
    assert nats_of(ways, replace(wall, nodes=np.array([1])), wall, SolverKernel.NUMPY) == pytest.approx(3.0)


def test_nothing_heard_speaks_for_no_way():
    nothing = post(1, [5.0, 0.0]).selected(np.zeros(0, dtype=int))
    np.testing.assert_array_equal(nats_of(ways_of(0), nothing, post(0, [5.0, 0.0]), SolverKernel.NUMPY), np.zeros(40))


def test_some_ways_are_led_to_where_echoes_that_stand_alone_meet():
    rng, ways = np.random.RandomState(0), begun(400, np.zeros(2), 0.0, np.random.RandomState(0))
    ways = ways.continued(np.zeros((400, 2)), ways.speeds, 9)
    far = ways.paths[:, -1] + 100.0
    ends, speeds = led(ways, (far, ways.speeds), post(1, [3.0, 0.0], 1.0), post(0, [6.0, 1.0]), PART, rng)
    moved = ends[:, 0] < 50.0
    assert 50 < moved.sum() < 200
    np.testing.assert_allclose(ends[moved], np.tile([3.0, 1.0], (moved.sum(), 1)), atol=1.5)
    np.testing.assert_allclose(speeds[moved], ends[moved] / PART)


def test_no_way_is_led_faster_than_a_small_vehicle_goes():
    rng, ways = np.random.RandomState(0), begun(400, np.zeros(2), 0.0, np.random.RandomState(0))
    ways = ways.continued(np.zeros((400, 2)), ways.speeds, 9)
    ends, _ = led(ways, (np.zeros((400, 2)), ways.speeds), post(1, [3.0, 0.0]), post(0, [60.0, 1.0]), PART, rng)
    np.testing.assert_array_equal(ends, np.zeros((400, 2)))


def test_a_speed_is_kept_in_map_or_in_base_link_or_ends():
    ways = Ways(np.zeros((3000, 1, 2)), np.tile([0.6, 0.0], (3000, 1)), np.zeros(3000))
    _, speeds = drawn(ways, PART, np.pi / 2.0, np.random.RandomState(0))
    for kept, least in (([0.6, 0.0], 0.25), ([0.0, 0.6], 0.25), ([0.0, 0.0], 0.08)):
        assert (np.hypot(*(speeds - kept).T) < 0.2).mean() > least


def test_ways_of_one_place_are_drawn_anew_as_often_as_they_are_believed():
    rng = np.random.RandomState(1)
    ways = Ways(rng.uniform(0.1, 1.9, (1000, 4, 2)), rng.normal(size=(1000, 2)), np.full(1000, -50.0))
    ways.nats[:10] = 0.0
    again = ways.resampled(np.random.RandomState(0))
    assert {tuple(end) for end in again.paths[:, -1]} == {tuple(end) for end in ways.paths[:10, -1]}
    np.testing.assert_allclose(again.nats, np.zeros(1000), atol=1e-9)


def test_a_place_believed_little_keeps_its_belief_and_more_ways_than_that():
    paths = np.full((1000, 2, 2), 1.0)
    paths[:10, 1] = [31.0, 1.0]
    ways = Ways(paths, np.zeros((1000, 2)), np.where(np.arange(1000) < 10, 0.0, -0.5 * np.arange(1000)))
    ways.nats[10] = np.log(990.0)
    again = ways.resampled(np.random.RandomState(0))
    far = again.paths[:, -1, 0] > 30.0
    assert again.shares[far].sum() == pytest.approx(ways.shares[:10].sum(), rel=0.1)
    assert far.mean() > 5.0 * ways.shares[:10].sum()


def test_ways_that_all_count_are_not_drawn_anew():
    ways = ways_of(1)._replace(nats=np.zeros(40))
    assert ways.resampled(np.random.RandomState(0)) is ways


def test_the_most_believed_path_is_that_of_the_larger_group():
    paths = np.zeros((10, 2, 2))
    paths[:6, 1], paths[6:, 1] = [4.0, 0.0], [-9.0, 0.0]
    ways = Ways(paths, np.zeros((10, 2)), np.zeros(10))
    np.testing.assert_allclose(ways.most_believed()[-1], [4.0, 0.0])
    assert np.sqrt(ways.spread()[0, 0]) == pytest.approx(13.0 * np.sqrt(0.24))


def test_nodes_on_a_path_have_its_places_and_its_speeds_in_base_link():
    times, heading = np.arange(4) * PART, np.pi / 2.0
    motion = OdometryTimeline.of(Track(times, np.tile([1.0, 2.0, heading], (4, 1)))).motion(times)
    assert isinstance(motion, Motion)
    nodes = on_path(np.zeros((4, 6)), np.column_stack([0.5 * times, np.zeros(4)]), motion)
    np.testing.assert_allclose(nodes[:, :2] + [1.0, 2.0], np.column_stack([0.5 * times, np.zeros(4)]), atol=1e-9)
    np.testing.assert_allclose(nodes[:, [AHEAD, ASIDE]], np.tile([0.0, -0.5], (4, 1)), atol=1e-9)
