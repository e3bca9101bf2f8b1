import math

import numpy as np
import pytest

from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.thesis_models import CollisionParameters
from sonar_simulator.rays.beam_pattern import BeamPattern
from sonar_simulator.rays.beam_tracer import Contacts

EXACT = {"increments": 0}


def _echoes(ranges, seed=0, **values):
    return make_echo_model("collision", values).echoes(Contacts.of_ranges(ranges), np.random.default_rng(seed))[0]


def test_the_defaults_are_the_thesis_numbers():
    parameters = CollisionParameters()
    assert (parameters.spread, parameters.increments, parameters.noise_echoes, parameters.saturation) == (
        0.6,
        10,
        0,
        127,
    )


def test_the_fullest_bin_is_the_strongest_and_the_others_are_in_proportion():
    strengths = _echoes([10.05] * 4 + [20.05] * 2, **EXACT)
    assert {index: strengths[index] for index in np.flatnonzero(strengths)} == {100: 127, 200: 64}


def test_a_single_contact_is_heard_beside_any_number_of_others():
    assert _echoes([10.05] + [20.05] * 5000, **EXACT)[100] == 1


def test_contacts_are_added_around_each_contact_with_the_spread_asked_for():
    strengths = _echoes(np.full(2000, 25.05), increments=50, spread=0.6)
    ranges = (np.arange(500) + 0.5) * 0.1
    mean = np.average(ranges, weights=strengths)
    assert mean == pytest.approx(25.05, abs=0.05)
    assert math.sqrt(np.average((ranges - mean) ** 2, weights=strengths)) == pytest.approx(0.6, abs=0.05)


def test_a_beam_that_hits_nothing_is_silent():
    assert not _echoes(np.full(100, np.inf)).any()


def test_noise_can_be_added_as_in_the_laser_cone():
    assert np.count_nonzero(_echoes([25.05], increments=0, noise_echoes=15)) > 5


def test_the_same_seed_gives_the_same_bytes():
    ranges = np.linspace(5.0, 45.0, 100)
    assert _echoes(ranges, 7).tobytes() == _echoes(ranges, 7).tobytes() != _echoes(ranges, 8).tobytes()


def test_its_rays_fill_a_round_cone_of_the_opening():
    cone = make_echo_model("collision", {"opening_deg": 30.0}).pattern(BeamPattern(0.1, 0.1, 50, 40))
    rays = cone.sample(3, np.random.default_rng(0))
    off_axis = np.degrees(np.arccos(rays[..., 0]))
    assert rays.shape == (3, 2000, 3)
    assert off_axis.max() <= 15.0 + 1e-9
    assert off_axis.max() > 14.8
    # Even over the cone's section: half of the rays lie within 1 / sqrt(2) of its radius.
    assert np.mean(np.tan(np.radians(off_axis)) < np.tan(np.radians(15.0)) / math.sqrt(2.0)) == pytest.approx(
        0.5, abs=0.01
    )
    assert (rays @ cone.planes().T >= -1e-12).all()
