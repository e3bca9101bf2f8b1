import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.rays.ray_grid import contacts_of_grid

ELEVATIONS = np.linspace(-0.19, 0.19, 9)
BEARINGS = np.linspace(-0.02, 0.02, 5)


def _wall(turn, rise):
    """Return the ranges of rays to a plane 10 m ahead, turned about z and then tilted, and its incidence cosines."""
    normal = np.array([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)])
    directions = np.array(
        [[[np.cos(e) * np.cos(b), np.cos(e) * np.sin(b), np.sin(e)] for b in BEARINGS] for e in ELEVATIONS]
    )
    cosines = directions @ normal
    return 10.0 * normal[0] / cosines, cosines


@given(st.floats(-1.0, 1.0), st.floats(-0.8, 0.8))
def test_incidence_on_a_wall_is_that_of_its_plane(turn, rise):
    ranges, cosines = _wall(turn, rise)
    contacts = contacts_of_grid(ranges, ELEVATIONS, BEARINGS)
    np.testing.assert_allclose(contacts.cosines.reshape(ranges.shape), cosines, atol=1e-9)


def test_the_edge_between_two_walls_does_not_look_like_a_surface():
    ranges, _ = _wall(0.0, 0.0)
    ranges[:, 3:] *= 3.0
    assert contacts_of_grid(ranges, ELEVATIONS, BEARINGS).cosines.min() > 0.95


def test_one_row_takes_surfaces_as_upright():
    ranges, _ = _wall(0.6, 0.0)
    contacts = contacts_of_grid(ranges[4:5], ELEVATIONS[4:5], BEARINGS)
    np.testing.assert_allclose(contacts.cosines, np.cos(BEARINGS - 0.6)[np.newaxis], atol=1e-9)


@pytest.mark.parametrize("nothing", [np.inf, np.nan, 0.0, -1.0])
def test_a_ray_without_a_range_hits_nothing(nothing):
    ranges, _ = _wall(0.0, 0.0)
    ranges[0, 0] = nothing
    assert np.isinf(contacts_of_grid(ranges, ELEVATIONS, BEARINGS).ranges[0]).sum() == 1


def test_laser_retro_is_the_reflection_and_0_the_default():
    ranges, _ = _wall(0.0, 0.0)
    contacts = contacts_of_grid(ranges, ELEVATIONS, BEARINGS, np.where(ranges > 0, np.arange(5) / 5.0, 0.0))
    reflections = [contacts.materials[index].reflection for index in contacts.material[0, :5]]
    assert reflections == pytest.approx([0.68, 0.2, 0.4, 0.6, 0.8])


@pytest.mark.parametrize("model", ["laser_cone", "collision", "physical"])
def test_every_model_hears_a_grid(model):
    ranges, _ = _wall(0.3, 0.0)
    strengths = make_echo_model(model, {}).echoes(
        contacts_of_grid(ranges, ELEVATIONS, BEARINGS), np.random.default_rng(0)
    )
    assert strengths.shape == (1, 500)
    assert strengths[0, 90:115].max() > 20


def test_shapes_that_disagree_are_refused():
    with pytest.raises(ValueError, match=r"ranges \(3, 3\), must be 9 elevations x 5 bearings"):
        contacts_of_grid(np.ones((3, 3)), ELEVATIONS, BEARINGS)
