"""Peaks and plateaus: what the strengths of a recording say of its echoes."""

import numpy as np
import pytest

from mlsm_manager.offline.echo_shape import EchoShape, echo_shape_of, suited
from mlsm_manager.offline.replay_parameters import ReplayParameters
from sonar_processing.beams.beam import Beam
from sonar_processing.filters.echo_extraction import ExtractionMode


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
