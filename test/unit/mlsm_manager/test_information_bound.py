"""The bound on what any solver can reach, on a tour of a walled harbour that turns all the time."""

import numpy as np
import pytest
from benchmarks.information_bound import bounds
from made_harbour import HARBOUR, tour

from node_support.geometry import pose_matrix
from sonar_simulator.world.world import Shape, World

SCANS = 24
COMPASS = 0.01745  # rad, standard deviation of the compass that the bound assumes
HEAD_STEP = np.radians(3.0)


def walls():
    """Return thin boxes along the harbour's edges."""
    starts, ends = HARBOUR, np.roll(HARBOUR, -1, axis=0)
    lengths, angles = np.hypot(*(ends - starts).T), np.arctan2(*(ends - starts).T[::-1])
    return [
        Shape("wall", "box", pose_matrix((*middle, 0.0), (0.0, 0.0, angle)), (length, 0.001, 6.0))
        for middle, length, angle in zip((starts + ends) / 2.0, lengths, angles)
    ]


def circling(times):
    """Return poses (n, 3) on circles of 4 m around a point that goes along the harbour: bent between any two scans."""
    angles = times / 6.0
    return np.column_stack([4.0 * np.cos(angles) - 15.0 + times / 16.0, 4.0 * np.sin(angles), angles + np.pi / 2.0])


@pytest.fixture(scope="module")
def made():
    """Return the tour and its bounds."""
    held = tour(SCANS, noise=0.005, path=circling)
    return held, bounds(held.scans, held.truth, World.from_shapes("harbour", walls()), HEAD_STEP)


def test_sharp_echoes_do_not_tell_where_north_is(made):
    held, found = made
    ends = held.truth.at(np.array([scan.reference_time for scan in held.scans]))[:, :2]
    distance = np.median(np.hypot(*(ends - held.truth.poses[0, :2]).T))
    assert found.unknown > 0.7 * COMPASS * distance


def test_a_known_map_tells_more_than_an_unknown_one(made):
    assert made[1].known < 0.5 * made[1].unknown


def test_the_shape_of_the_path_is_told_by_the_echoes(made):
    assert made[1].shape < 0.05
