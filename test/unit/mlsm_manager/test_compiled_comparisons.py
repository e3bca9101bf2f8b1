"""Places of points and comparisons by compiled loops are those by numpy, but for rounding."""

import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_harbour import SONAR_IN_BASE, logged, tour

from mlsm_manager.joint_solver.compare.association import Pairs
from mlsm_manager.joint_solver.compare.comparing import Comparing
from mlsm_manager.joint_solver.motion.dvl_factors import DvlFactors
from mlsm_manager.joint_solver.motion.heading_factors import HeadingFactors
from mlsm_manager.joint_solver.motion.odometry_parameters import (
    DvlOdometry,
    HeadingOdometry,
    ThrusterOdometry,
    UnaidedOdometry,
)
from mlsm_manager.joint_solver.motion.thruster_factors import ThrusterFactors
from mlsm_manager.joint_solver.motion.unaided_factors import UnaidedFactors
from mlsm_manager.joint_solver.parameters import MultiViewParameters, SurfaceMatching
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place
from mlsm_manager.joint_solver.solve.batch_solver import solved
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.joint_solver.unknowns.state import State
from mlsm_manager.offline.replay_parameters import ReplayParameters

pytest.importorskip("numba")
SAME = 1e-9
MODELS = [
    DvlFactors(DvlOdometry()), ThrusterFactors(ThrusterOdometry()), HeadingFactors(HeadingOdometry()),
    UnaidedFactors(UnaidedOdometry()),
]  # fmt: skip


def some_points(rng, count, scans):
    return PlacedPoints(
        scans=np.sort(rng.choice(scans, count)), places=rng.normal(0.0, 3.0, (count, 2)),
        arms=rng.normal(0.0, 9.0, (count, 2)), normals=rng.normal(0.0, 1.0, (count, 2)),
        slants=rng.uniform(0.0, 5.0, count), qualities=np.ones(count), shares=rng.uniform(0.0, 1.0, count),
        by_run=rng.normal(0.0, 5.0, (count, 2, 2)),
    )  # fmt: skip


def sums_by_scans(kernel, *arguments):
    """Return both scans, information and gradient of all pairs of scans, in the order of the scans."""
    sums = Comparing.by(kernel).summed(*arguments)
    order = np.lexsort((sums[1], sums[0]))
    return [part[order] for part in sums]


@given(st.integers(0, 10**6), st.integers(1, 200), st.sampled_from([[-2], [0], [3, 4, 9], list(range(40))]))
@settings(max_examples=50)
def test_sums_of_any_comparisons_are_the_same(seed, count, scans):
    rng, matching = np.random.RandomState(seed), SurfaceMatching()
    sources, targets = some_points(rng, 30, list(range(50, 60))), some_points(rng, 40, scans)
    pairs = Pairs(np.sort(rng.randint(0, 30, count)), rng.randint(0, 40, count), rng.uniform(0.1, 1.0, count))
    for cut in (matching.cut, matching.wide_cut):
        one, other = (
            sums_by_scans(kernel, pairs, sources, targets, matching, cut)
            for kernel in (SolverKernel.NUMPY, SolverKernel.NUMBA)
        )
        for expected, found in zip(one, other):
            np.testing.assert_allclose(found, expected, rtol=SAME, atol=SAME * np.abs(expected).max())


def test_a_sonar_s_place_may_be_a_column_of_a_matrix_as_live_nodes_have_it():
    T_base_sonar = np.eye(4)
    T_base_sonar[:2, 3] = SONAR_IN_BASE
    solvers = [
        LiveSolver(MultiViewParameters(kernel=SolverKernel.NUMBA), place)
        for place in (SONAR_IN_BASE, T_base_sonar[:2, 3])
    ]
    for scan in tour(2).scans:
        expected, found = (solver.add(scan) for solver in solvers)
    np.testing.assert_array_equal(found.node, expected.node)


@pytest.fixture(scope="module")
def log():
    return logged(tour(3, direction=0.1, delay=0.3).scans)


@pytest.mark.parametrize("odometry", MODELS, ids=lambda model: type(model).__name__)
@pytest.mark.parametrize("delay", [0.0, -1.7, 900.0])
def test_points_lie_at_the_same_places_whatever_the_odometry_tells(log, odometry, delay):
    nodes = np.random.RandomState(1).normal(0.0, 0.2, (log.scan_count + 1, odometry.width))
    expected, found = (
        place(log, odometry, State(nodes, np.array([0.01, delay])), log.rows(1, 3), Comparing.by(kernel).placed)
        for kernel in (SolverKernel.NUMPY, SolverKernel.NUMBA)
    )
    for field in fields(PlacedPoints):
        one, other = getattr(expected, field.name), getattr(found, field.name)
        np.testing.assert_allclose(other, one, rtol=SAME, atol=SAME * np.abs(one).max(), err_msg=field.name)


def test_no_points_lie_nowhere(log):
    state = State(np.zeros((log.scan_count + 1, 5)), np.zeros(2))
    assert not len(place(log, MODELS[0], state, log.rows(0, 0), Comparing.by(SolverKernel.NUMBA).placed))


@given(st.integers(0, 10**6), st.integers(0, 100))
@settings(max_examples=30)
def test_comparisons_count_as_much(seed, count):
    rng, matching = np.random.RandomState(seed), SurfaceMatching()
    sources, targets = some_points(rng, 30, [5, 6]), some_points(rng, 40, [0, 1, 2])
    found = (
        np.sort(rng.randint(0, 30, count)), rng.randint(0, 40, count), rng.uniform(0.0, 3.0, count),
        rng.uniform(0.1, 1.0, count),
    )  # fmt: skip
    expected, pairs = (
        Comparing.by(kernel).weighed(found, sources, targets, matching.cut, matching)
        for kernel in (SolverKernel.NUMPY, SolverKernel.NUMBA)
    )
    np.testing.assert_array_equal(pairs.rows, expected.rows)
    np.testing.assert_array_equal(pairs.neighbours, expected.neighbours)
    np.testing.assert_allclose(pairs.importance, expected.importance, rtol=SAME)


@given(st.integers(0, 10**6), st.integers(0, 20))
@settings(max_examples=30)
def test_blocks_are_added_to_the_same_places_of_a_matrix(seed, count):
    rng = np.random.RandomState(seed)
    columns, blocks = rng.randint(0, 7, (count, 3)), rng.normal(0.0, 1.0, (count, 3, 3))
    expected, found = np.ones((7, 7)), np.ones((7, 7))
    Comparing.by(SolverKernel.NUMPY).scattered(expected, columns, blocks)
    Comparing.by(SolverKernel.NUMBA).scattered(found, columns, blocks)
    np.testing.assert_allclose(found, expected, atol=SAME)


def test_a_run_is_solved_alike_live_and_afterwards():
    runs = []
    for kernel in (SolverKernel.NUMPY, SolverKernel.NUMBA):
        live = LiveSolver(replace(MultiViewParameters(), kernel=kernel), SONAR_IN_BASE)
        for scan in tour(8, direction=0.1, delay=0.3).scans:
            live.add(scan)
        runs.append((live, solved(live)))
    (live, batch), (compiled_live, compiled_batch) = runs
    np.testing.assert_allclose(compiled_live.state.nodes, live.state.nodes, atol=SAME)
    np.testing.assert_allclose(compiled_live.estimates[-1].covariance, live.estimates[-1].covariance, atol=SAME)
    np.testing.assert_allclose(compiled_batch.state.nodes, batch.state.nodes, atol=SAME)
    assert compiled_batch.steps == batch.steps


def test_points_without_a_finite_place_are_refused():
    points = some_points(np.random.RandomState(0), 20, [0, 1])
    lost = replace(points, places=points.places * np.where(np.arange(20) == 7, np.nan, 1.0)[:, np.newaxis])
    with pytest.raises(ValueError, match="without a finite place"):
        Comparing.by(SolverKernel.NUMBA).neighbours(points, 5).within(lost, points, 2.0)


@pytest.mark.parametrize("kernel", ["AUTO", "NUMBA"])
def test_the_loops_are_compiled_before_the_first_scan(kernel, monkeypatch):
    module = "mlsm_manager.joint_solver.compiled.compiled_search"
    monkeypatch.delitem(sys.modules, module, raising=False)
    ReplayParameters(solver_kernel=kernel).build_localiser()
    assert module in sys.modules


def test_where_numba_is_installed_it_is_chosen():
    assert SolverKernel.AUTO.resolved is SolverKernel.NUMBA
