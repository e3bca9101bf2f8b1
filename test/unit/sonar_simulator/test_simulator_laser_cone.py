import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from node_support.parameters import ParameterError
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.rays.beam_tracer import Contacts

NOISE_FREE = {"spread": 0.0, "noise_echoes": 0}


def _echoes(distances, seed=0, **values):
    beams = make_echo_model("laser_cone", values).echoes(Contacts.of_ranges(distances), np.random.default_rng(seed))
    return beams[0] if np.ndim(distances) == 1 else beams


@given(st.floats(0.001, 50.0))
def test_a_contact_falls_into_the_bin_that_covers_its_range(distance):
    (index,) = np.flatnonzero(_echoes([distance], **NOISE_FREE))
    assert index * 0.1 - 1e-9 <= distance <= (index + 1) * 0.1 + 1e-9


def test_each_contact_adds_15():
    assert _echoes([10.05, 10.05, 20.05], **NOISE_FREE)[[100, 200]].tolist() == [30, 15]


def test_strength_saturates_at_127():
    assert _echoes(np.full(500, 10.05), **NOISE_FREE).max() == 127


def test_rays_without_a_hit_or_beyond_the_range_give_nothing():
    assert not _echoes([np.inf, 50.01, 1e4], **NOISE_FREE).any()


def test_a_beam_that_hits_nothing_has_no_noise():
    assert not _echoes(np.full(500, np.inf)).any()


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


@settings(max_examples=30)
@given(st.floats(0.0, 255.0), st.floats(0.0, 255.0))
def test_noise_never_leaves_0_to_127(mean, sd):
    strengths = _echoes(np.full(50, 25.0), noise_strength_mean=mean, noise_strength_sd=sd, noise_echoes=500)
    assert strengths.max() <= 127


def test_a_batch_gives_one_row_per_beam():
    strengths = _echoes([[10.05, np.inf], [np.inf, np.inf], [20.05, 30.05]], **NOISE_FREE)
    assert strengths.shape == (3, 500)
    assert [np.flatnonzero(row).tolist() for row in strengths] == [[100], [], [200, 300]]


def test_the_same_seed_gives_the_same_bytes():
    distances = np.linspace(5.0, 45.0, 500)
    assert _echoes(distances, seed=7).tobytes() == _echoes(distances, seed=7).tobytes()
    assert _echoes(distances, seed=7).tobytes() != _echoes(distances, seed=8).tobytes()


def test_bins_and_range_are_as_asked_for():
    strengths = _echoes([4.88], bins=100, max_range=5.0, **NOISE_FREE)
    assert strengths.dtype == np.uint8
    assert np.flatnonzero(strengths).tolist() == [97]


def test_an_unknown_model_is_refused_with_the_names_there_are():
    with pytest.raises(ParameterError, match=r"echo_model = 'cone'.*laser_cone"):
        make_echo_model("cone", {})


def test_a_bad_value_is_refused_with_its_key():
    with pytest.raises(ParameterError, match="spread = -1"):
        make_echo_model("laser_cone", {"spread": -1})
