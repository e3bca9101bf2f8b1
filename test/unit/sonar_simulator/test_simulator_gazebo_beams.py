"""Beams made of what the rays of Gazebo's sensors hit."""

import math

import numpy as np
import pytest

from node_support.parameters import ParameterError
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.echoes.ray_grid import Rays, contacts_of_grid
from sonar_simulator.gazebo_parameters import GazeboSonarParameters
from sonar_simulator.simulation.sonar_head import SonarHead

ELEVATIONS = np.radians(np.linspace(-11.0, 11.0, 15))
QUIET = {"spread": 0.0, "noise_echoes": 0}


def _strengths(rays, name="laser_cone", **values):
    return make_echo_model(name, values).echoes(contacts_of_grid(rays), np.random.default_rng(1))[0]


def _wall(bearings, distance=12.0):
    """Rays that meet a wall across the x axis."""
    ranges = distance / (np.cos(ELEVATIONS)[:, np.newaxis] * np.cos(bearings))
    return Rays(np.where((ranges > 0.0) & (ranges < 50.0), ranges, np.inf), ELEVATIONS, bearings, None)


PYRAMID = _wall(np.radians(np.linspace(-1.25, 1.25, 5)))
CIRCLE = _wall(np.linspace(-math.pi, math.pi, 721))


@pytest.mark.parametrize("name", ECHO_MODELS)
def test_every_echo_model_hears_a_wall_where_it_is(name):
    strengths = _strengths(PYRAMID, name)
    assert abs(int(np.argmax(strengths)) - 120) <= 15
    assert strengths.dtype == np.uint8
    assert strengths.shape == (500,)


def test_the_first_echo_is_in_the_bin_of_the_nearest_ray():
    assert np.flatnonzero(_strengths(PYRAMID, **QUIET))[0] == math.ceil(12.0 * 10.0) - 1


def test_a_swept_sensor_hears_the_wall_all_around():
    first = []
    for beam in range(120):
        strengths = _strengths(CIRCLE.within(SonarHead(120, 16.0).angle(beam), math.radians(2.5)), **QUIET)
        first.append(np.flatnonzero(strengths)[0] if strengths.any() else -1)
    assert abs(first[0] - 119) <= 1
    assert first[60] == -1
    # 60 degrees to either side the wall is twice as far, less what the beam's inner edge gains.
    nearest = 12.0 / math.cos(math.radians(60.0 - 1.25)) * 10.0
    assert abs(first[20] - nearest) <= 2
    assert abs(first[100] - nearest) <= 2


def test_a_scan_that_hits_nothing_is_a_silent_beam():
    assert not _strengths(Rays(np.full((15, 5), np.inf), ELEVATIONS, PYRAMID.bearings, None)).any()


def test_an_unknown_echo_model_is_refused():
    with pytest.raises(ParameterError, match="echo_model = 'cone': must be one of laser_cone, collision, physical"):
        GazeboSonarParameters(echo_model="cone")
