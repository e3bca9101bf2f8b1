"""Peaks and plateaus: what the strengths of a recording say of its echoes."""

import numpy as np
import pytest

from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.offline.suited_parameters import EchoShape, echo_shape_of, echo_sigma, suited
from sonar_processing.beams.beam import Beam
from sonar_processing.filters.echo_extractor import ExtractionMode


def beams(strengths):
    return [Beam(10**9, "sonar", 0.0, np.array(strengths, dtype=np.uint8), 0.1)]


@pytest.mark.parametrize("strongest", [1, 127, 255])
def test_strengths_that_say_something_or_nothing_are_plateaus(strongest):
    assert echo_shape_of(beams([0, 0, strongest, strongest, strongest, 0])) is EchoShape.PLATEAU


def test_strengths_that_differ_are_peaks():
    assert echo_shape_of(beams([0, 3, 60, 127, 127, 80, 5, 0])) is EchoShape.PEAK


def test_a_recording_of_silence_has_no_plateaus():
    assert echo_shape_of(beams([0, 0, 0])) is EchoShape.PEAK


def test_plateaus_are_taken_as_dense_points_with_a_less_certain_range():
    parameters = suited(ReplayParameters(), EchoShape.PLATEAU, fixed=())
    assert (parameters.mode, parameters.match_resolution, parameters.range_scale_deviation) == (
        ExtractionMode.DENSE, 1.0, 0.05,
    )  # fmt: skip


def test_what_the_user_set_is_held():
    parameters = suited(ReplayParameters(match_resolution=0.7), EchoShape.PLATEAU, fixed=("match_resolution",))
    assert (parameters.mode, parameters.match_resolution) == (ExtractionMode.DENSE, 0.7)


def echoing(sigma, resolution=0.1, noise=0.0, seed=0):
    rng, bins = np.random.RandomState(seed), np.arange(400)
    rows = [
        90.0 * np.exp(-0.5 * ((bins - place) * resolution / sigma) ** 2) + np.abs(rng.normal(0.0, noise, 400))
        for place in rng.uniform(60.0, 340.0, 120)
    ]
    return [Beam(10**9, "sonar", 0.0, row.astype(np.uint8), resolution) for row in rows]


@pytest.mark.parametrize("sigma", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_the_length_of_echoes_is_found(sigma, noise):
    assert echo_sigma(echoing(sigma, noise=noise)) == pytest.approx(sigma, rel=0.15)


@pytest.mark.parametrize("strengths", [[0, 0, 0, 0, 0], [7], [9, 9, 9, 9, 9, 9]])
def test_without_echoes_the_shortest_pulse_is_taken(strengths):
    assert echo_sigma(beams(strengths)) == 0.15


def test_beams_of_another_range_do_not_matter():
    other = [Beam(10**9, "sonar", 0.0, np.zeros(50, dtype=np.uint8), 0.5)] * 3
    assert echo_sigma(other + echoing(0.5)) == echo_sigma(echoing(0.5))


def test_peaks_are_filtered_by_their_own_length_unless_it_was_set():
    assert suited(ReplayParameters(), EchoShape.PEAK, (), 0.7).pulse_sigma == 0.7
    assert suited(ReplayParameters(), EchoShape.PEAK, ("pulse_sigma",), 0.7).pulse_sigma == 0.15
    assert suited(ReplayParameters(), EchoShape.PLATEAU, (), 0.7).pulse_sigma == 0.15
