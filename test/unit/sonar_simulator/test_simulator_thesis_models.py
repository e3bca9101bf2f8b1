"""The echo models of the thesis."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_simulator.echoes.beam_tracer import BeamPattern, Contacts
from sonar_simulator.echoes.echo_model import make_echo_model

NOISE_FREE = {"spread": 0.0, "noise_echoes": 0}


def _echoes(distances, model="laser_cone", **values):
    return make_echo_model(model, values).echoes(Contacts.of_ranges(distances), np.random.default_rng(0))[0]


@given(st.floats(0.001, 50.0))
def test_a_contact_falls_into_the_bin_that_covers_its_range(distance):
    (index,) = np.flatnonzero(_echoes([distance], **NOISE_FREE))
    assert index * 0.1 - 1e-9 <= distance <= (index + 1) * 0.1 + 1e-9


def test_each_contact_adds_15_up_to_127():
    assert _echoes([10.05, 10.05, 20.05], **NOISE_FREE)[[100, 200]].tolist() == [30, 15]
    assert _echoes(np.full(500, 10.05), **NOISE_FREE).max() == 127


@pytest.mark.parametrize("model", ["laser_cone", "collision"])
def test_a_beam_without_a_contact_within_the_range_is_silent_and_has_no_noise(model):
    assert not _echoes([np.inf, 50.01, 1e4], model).any()


def test_echoes_spread_about_the_contact_by_the_standard_deviation_asked_for():
    strengths = _echoes(np.full(100000, 25.0), spread=0.5, noise_echoes=0, echo_strength=1, saturation=255)
    occupied = np.flatnonzero(_echoes(np.full(300, 25.0), spread=0.5, noise_echoes=0))
    assert strengths[250] == 255
    assert (occupied.mean() + 0.5) * 0.1 == pytest.approx(25.0, abs=0.2)
    assert 2.0 < np.ptp(occupied) * 0.1 < 4.0


def test_echoes_that_spread_to_negative_ranges_are_dropped_and_not_heaped_into_the_first_bin():
    strengths = _echoes(np.full(1000, 0.05), spread=1.0, noise_echoes=0, echo_strength=1, saturation=255)
    assert strengths[0] < 100


def test_noise_overwrites_what_was_there():
    strengths = _echoes(np.full(500, 25.05), spread=0.0, noise_range_sd=0.0, noise_strength_sd=0.0)
    assert strengths[250] == 53


def test_noise_lies_around_the_nearest_contact():
    strengths = _echoes([10.0, 40.0], echo_strength=0, noise_echoes=200)
    ranges = np.flatnonzero(strengths) * 0.1
    assert ranges.mean() == pytest.approx(10.0, abs=1.5)


@given(st.floats(0.0, 255.0), st.floats(0.0, 255.0))
def test_noise_never_leaves_0_to_127(mean, sd):
    strengths = _echoes(np.full(50, 25.0), noise_strength_mean=mean, noise_strength_sd=sd, noise_echoes=500)
    assert strengths.max() <= 127


EXACT = {"increments": 0}


def test_the_fullest_bin_is_the_strongest_and_the_others_are_in_proportion():
    strengths = _echoes([10.05] * 4 + [20.05] * 2, "collision", **EXACT)
    assert {index: strengths[index] for index in np.flatnonzero(strengths)} == {100: 127, 200: 64}


def test_a_single_contact_is_heard_beside_any_number_of_others():
    assert _echoes([10.05] + [20.05] * 5000, "collision", **EXACT)[100] == 1


def test_contacts_are_added_around_each_contact_with_the_spread_asked_for():
    strengths = _echoes(np.full(2000, 25.05), "collision", increments=50, spread=0.6)
    ranges = (np.arange(500) + 0.5) * 0.1
    mean = np.average(ranges, weights=strengths)
    assert mean == pytest.approx(25.05, abs=0.05)
    assert math.sqrt(np.average((ranges - mean) ** 2, weights=strengths)) == pytest.approx(0.6, abs=0.05)


def test_noise_can_be_added_as_in_the_laser_cone():
    assert np.count_nonzero(_echoes([25.05], "collision", increments=0, noise_echoes=15)) > 5


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
