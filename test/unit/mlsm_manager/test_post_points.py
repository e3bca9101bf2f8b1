"""Echoes that stand alone tell the way along straight walls."""

from dataclasses import replace

import numpy as np
import pytest
from made_models import HEADING, followed, solver_parameters
from made_posts import SPEED, cluttered, heard, true_path

from mlsm_manager.joint_solver.batch_solver import fit_of
from mlsm_manager.joint_solver.surface_points import Sights, SurfacePoints, post_points
from mlsm_manager.scan_matching.scan import Scan, Track

pytestmark = pytest.mark.long

STRONG, WEAK = 100.0, 30.0
WALL = np.column_stack([np.linspace(-10.0, 10.0, 41), np.full(41, 8.0)])
AT_BASE = np.zeros(2)
TURNS = 24


def scan_of(places, strengths):
    count = len(places)
    points = np.column_stack([places, np.zeros(count), strengths])
    times = np.linspace(0.0, 10.0, count)
    track = Track(np.array([-1.0, 12.0]), np.zeros((2, 3)))
    return Scan(points, times, np.zeros(count, dtype=bool), track, 10.0)


def found_in(scan, sonar_in_base=AT_BASE):
    sights = Sights.of(scan, sonar_in_base)
    return post_points(scan, sights, SurfacePoints.of(scan, sights))


def wall_and(place, strength):
    """Return a scan of a wall with strong and weak echoes, and of one echo beside it."""
    strengths = np.where(np.arange(len(WALL)) % 2, STRONG, WEAK)
    return scan_of(np.vstack([WALL, [place]]), np.append(strengths, strength))


def test_a_strong_echo_far_from_all_others_stands_alone():
    found = found_in(wall_and([6.0, -7.0], STRONG))
    np.testing.assert_allclose(found.ranges, [np.hypot(6.0, 7.0)])
    np.testing.assert_allclose(found.bearings, [np.arctan2(-7.0, 6.0)])


def strong(places):
    return scan_of(places, np.full(len(places), STRONG))


ROW = np.column_stack([np.arange(-10.0, 11.0, 5.0), np.full(5, -7.0)])


@pytest.mark.parametrize(
    ("scan", "count"),
    [
        (strong(WALL), 0),
        (heard(1, posts=np.array([[100.0, 0.0]]))[0], 0),  # it travels with the vehicle: nothing would seem to move
        (wall_and([6.0, -7.0], WEAK), 0),
        (strong(np.empty((0, 2))), 0),
        (strong(np.vstack([WALL, ROW])), 0),
        (strong(np.vstack([WALL, [[6.0, -7.0], [6.0, -9.0]]])), 2),
    ],
    ids=["a wall", "a wall's end out of range", "speckle", "no echoes", "mistaken for each other", "side by side"],
)
def test_posts_are_strong_echoes_beside_surfaces_that_cannot_be_taken_for_each_other(scan, count):
    assert len(found_in(scan)) == count


def test_the_ray_to_the_echo_stands_for_its_normal():
    found = found_in(wall_and([6.0, -7.0], STRONG), np.array([1.0, 0.0]))
    np.testing.assert_allclose(found.normals, [[5.0, -7.0] / np.hypot(5.0, 7.0)])


def solver_of(scans, post_confidence):
    parameters = solver_parameters(
        odometry=HEADING, range_scale_deviation=0.0, normal_deviation=0.2, scans_per_group=1, echo_deviation=0.2,
        post_confidence=post_confidence,
    )  # fmt: skip
    return followed(scans, parameters, AT_BASE)


@pytest.fixture(scope="module")
def with_posts():
    return solver_of(heard(TURNS), post_confidence=1.0)


def gone(solver, nodes):
    """Return the way along the canal, and the true one [m]."""
    ends = true_path(solver.log.node_times)
    return nodes[-1, 0] - nodes[0, 0], ends[-1, 0] - ends[0, 0]


def test_posts_tell_the_way_along_a_canal(with_posts):
    for nodes in (with_posts.state.nodes, fit_of(with_posts.solution).state.nodes):
        found, true = gone(with_posts, nodes)
        assert found == pytest.approx(true, abs=1.5)


def test_the_told_deviation_is_smaller_where_posts_tell_the_way(with_posts):
    without = solver_of(heard(TURNS), post_confidence=0.0)
    known, unknown = (solver.estimates[-1].pose_covariance[0, 0] for solver in (with_posts, without))
    assert known < 0.1 * unknown


def test_speed_is_found_from_posts(with_posts):
    assert with_posts.estimates[-1].velocity[0] == pytest.approx(SPEED, abs=0.05)


@pytest.mark.parametrize("post_confidence", [0.0, 1.0])
def test_in_a_canal_with_clutter_the_told_deviation_covers_the_error(post_confidence):
    """Nothing tells the way along it, so the deviation is that of a speed which nobody knows."""
    bare = heard(TURNS, posts=np.array([[-500.0, 0.0]]))
    clear, disturbed = (solver_of(scans, post_confidence) for scans in (bare, cluttered(bare)))
    told = np.sqrt(disturbed.estimates[-1].pose_covariance[0, 0])
    found, true = gone(disturbed, disturbed.state.nodes)
    assert abs(found - true) < 3.0 * told
    assert told > 0.5 * np.sqrt(clear.estimates[-1].pose_covariance[0, 0])


def test_a_point_that_no_other_scan_heard_says_nothing():
    bare = heard(6, posts=np.array([[-500.0, 0.0]]))
    points, times = np.vstack([bare[3].points, [[3.0, 25.0, 0.0, STRONG]]]), np.append(bare[3].times, 48.0)
    bare[3] = replace(bare[3], points=points, times=times, moving=np.ones(len(times), dtype=bool))
    with_lone, without = (solver_of(bare, quality).estimates[-1].pose_covariance for quality in (1.0, 0.0))
    np.testing.assert_allclose(with_lone, without)
