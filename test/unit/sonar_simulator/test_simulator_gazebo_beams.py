import math

import numpy as np
import pytest

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.echoes.ray_grid import Rays
from sonar_simulator.gazebo_beams import GazeboBeams, GazeboSonarParameters, RayScan
from sonar_simulator.simulation.sonar_head import SonarHead

ELEVATIONS = np.radians(np.linspace(-11.0, 11.0, 15))
QUIET = {"spread": 0.0, "noise_echoes": 0}


def _beams(name="laser_cone", **values):
    return GazeboBeams(make_echo_model(name, values), seed=1)


def _wall(bearings, distance=12.0):
    """Rays that meet a wall across the x axis."""
    ranges = distance / (np.cos(ELEVATIONS)[:, np.newaxis] * np.cos(bearings))
    ranges = np.where((ranges > 0.0) & (ranges < 50.0), ranges, np.inf)
    return RayScan(Rays(ranges, ELEVATIONS, bearings, None), 0, "sonar")


PYRAMID = _wall(np.radians(np.linspace(-1.25, 1.25, 5)))
CIRCLE = _wall(np.linspace(-math.pi, math.pi, 721))


@pytest.mark.parametrize("name", ECHO_MODELS)
def test_every_echo_model_hears_a_wall_where_it_is(name):
    strengths = _beams(name).turned(PYRAMID, np.eye(4)).strengths
    assert abs(int(np.argmax(strengths)) - 120) <= 15
    assert strengths.dtype == np.uint8
    assert strengths.shape == (500,)


def test_the_first_echo_is_in_the_bin_of_the_nearest_ray():
    strengths = _beams(**QUIET).turned(PYRAMID, np.eye(4)).strengths
    assert np.flatnonzero(strengths)[0] == math.ceil(12.0 * 10.0) - 1


def test_a_turned_sensors_angle_is_its_yaw_in_the_sonars_frame():
    ping = _beams().turned(PYRAMID, pose_matrix((0.0, 0.0, 0.0), (0.0, 0.0, -2.0)))
    assert ping.angle == pytest.approx(-2.0)


def test_a_swept_sensor_gives_one_beam_after_the_other_all_around():
    beams, head = _beams(**QUIET), SonarHead(120, 16.0)
    pings = [beams.swept(CIRCLE, head, beam, math.radians(2.5)) for beam in range(120)]
    assert [ping.angle for ping in pings] == [head.angle(beam) for beam in range(120)]
    first = [np.flatnonzero(ping.strengths)[0] if ping.strengths.any() else -1 for ping in pings]
    assert abs(first[0] - 119) <= 1
    assert first[60] == -1
    # 60 degrees to either side the wall is twice as far, less what the beam's inner edge gains.
    nearest = 12.0 / math.cos(math.radians(60.0 - 1.25)) * 10.0
    assert abs(first[20] - nearest) <= 2
    assert abs(first[100] - nearest) <= 2


def test_a_scan_that_hits_nothing_is_a_silent_beam():
    silent = RayScan(Rays(np.full((15, 5), np.inf), ELEVATIONS, PYRAMID.rays.bearings, None), 0, "sonar")
    assert not _beams().turned(silent, np.eye(4)).strengths.any()


def test_an_unknown_echo_model_is_refused():
    with pytest.raises(ParameterError, match="echo_model = 'cone': must be one of laser_cone, collision, physical"):
        GazeboSonarParameters(echo_model="cone")
