"""Which points of other scans a point is compared with: as a look at all of them says, wherever the points move."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mlsm_manager.joint_solver.comparisons import TIE, Neighbours
from mlsm_manager.joint_solver.placement import PlacedPoints

SCANS = np.repeat(np.arange(6), 15)
BLOCK_SCANS = 3
CUT = 2.0


def placed(places, scans=SCANS):
    count = len(places)
    return PlacedPoints(
        scans=scans[:count], places=places, arms=np.zeros((count, 2)), normals=np.zeros((count, 2)),
        slants=np.zeros(count), qualities=np.ones(count), shares=np.zeros(count), by_run=np.zeros((count, 2, 2)),
    )  # fmt: skip


def looked_at_all(places, cut):
    """Return the shares of all pairs (n, n), each pair of points compared."""
    apart = np.hypot(*(places[:, np.newaxis] - places).transpose(2, 0, 1))
    apart[SCANS[:, np.newaxis] == SCANS] = np.inf
    result = np.zeros_like(apart)
    for of_block in (SCANS < BLOCK_SCANS, SCANS >= BLOCK_SCANS):
        nearest = np.where(of_block, apart, np.inf).min(axis=1)
        share = (
            np.maximum(1.0 - (apart - nearest[:, np.newaxis]) / TIE, 0.0) * of_block * (nearest < cut)[:, np.newaxis]
        )
        result += share / np.maximum(share.sum(axis=1, keepdims=True), 1e-12)
    return result


def as_matrix(found, count):
    rows, neighbours, _, shares = found
    result = np.zeros((count, count))
    np.add.at(result, (rows, neighbours), shares)
    return result


@given(st.integers(0, 1000), st.lists(st.floats(0.0, 3.0), max_size=4), st.floats(0.0, 9.0))
def test_neighbours_are_what_a_look_at_all_points_says_however_far_these_move(seed, moves, common):
    rng = np.random.RandomState(seed)
    places = rng.uniform(0.0, 15.0, (len(SCANS), 2))
    lists = Neighbours(placed(places), BLOCK_SCANS)
    for move in [0.0, *moves]:
        places = places + rng.normal(0.0, move, places.shape) + common
        found = lists.within(placed(places), placed(places), CUT)
        np.testing.assert_allclose(as_matrix(found, len(places)), looked_at_all(places, CUT), atol=1e-9)


def test_each_search_may_have_another_cut():
    places = np.random.RandomState(2).uniform(0.0, 15.0, (len(SCANS), 2))
    lists = Neighbours(placed(places), BLOCK_SCANS)
    for cut in (2.0, 1.0, 3.5):
        found = lists.within(placed(places), placed(places), cut)
        np.testing.assert_allclose(as_matrix(found, len(places)), looked_at_all(places, cut), atol=1e-9)


def test_two_neighbours_that_are_as_near_share_the_comparison():
    places = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
    source, others = placed(places[:1], np.array([9])), placed(places[1:], np.array([0, 1]))
    found = Neighbours(others, BLOCK_SCANS).within(source, others, CUT)
    np.testing.assert_array_equal(np.sort(found[1]), [0, 1])
    np.testing.assert_allclose(found[3], 0.5)


def test_no_neighbour_takes_over_at_once():
    """A point that moves past the middle between two others changes their shares as little as it moves."""
    others = placed(np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([0, 1]))
    shares = []
    for place in np.linspace(-0.04, 0.04, 81):
        source = placed(np.array([[place, 0.0]]), np.array([9]))
        rows = Neighbours(others, BLOCK_SCANS).within(source, others, CUT)
        shares.append(rows[3][rows[1] == 0].sum())
    steps = np.diff(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert steps.min() >= 0.0
    assert steps.max() < 2.5e-3 / TIE


def test_points_far_from_all_others_are_compared_with_nothing():
    source, others = placed(np.array([[50.0, 0.0]]), np.array([9])), placed(np.zeros((1, 2)), np.array([0]))
    assert not len(Neighbours(others, BLOCK_SCANS).within(source, others, CUT)[0])


def test_a_point_far_outside_costs_no_memory_and_hides_no_neighbour():
    others = placed(np.array([[0.0, 0.0], [1e9, -1e9]]), np.array([0, 1]))
    found = Neighbours(others, BLOCK_SCANS).within(placed(np.array([[0.5, 0.0]]), np.array([9])), others, CUT)
    assert found[1].tolist() == [0]
