"""Where beams are drawn in the picture."""

import math

import numpy as np
import pytest
from clouds import beam_of
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from sonar_processing.scans.image import PolarImage, SonarImageParameters

BINS = 50


def _drawn(angles, strengths=None, **values):
    picture = PolarImage(SonarImageParameters(**{"metres_per_pixel": 1.0, **values}))
    for angle in angles:
        image = picture.draw(beam_of(np.full(BINS, 200) if strengths is None else strengths, angle=angle))
    return image


@pytest.mark.parametrize(
    ("angle", "row", "column"),
    [(0.0, 20, 50), (math.pi / 2, 50, 20), (-math.pi / 2, 50, 80), (math.pi, 80, 50), (-math.pi, 80, 50),
     (math.pi / 4, 30, 30)],
)  # fmt: skip
def test_up_is_ahead_and_left_is_left(angle, row, column):
    image = _drawn([angle])
    assert image.shape == (101, 101)
    assert image[row, column] == 200
    assert image[100 - row, 100 - column] == 0


def test_bins_lie_at_their_ranges():
    strengths = np.zeros(BINS)
    strengths[30] = 99
    column = _drawn([0.0], strengths)[:51, 50]
    assert np.flatnonzero(column).tolist() == [20]


@given(st.floats(-10.0, 10.0), st.sampled_from([24, 120, 200, 400]), st.sampled_from([1, -1]))
def test_a_turn_fills_the_whole_disc(start, beams, direction):
    steps = 2 * math.pi / beams * np.arange(beams + 1) if beams > 31 else np.linspace(0, 2 * math.pi, 401)
    image = _drawn(start + direction * steps)
    up, left = np.mgrid[50:-51:-1, 50:-51:-1]
    inside = np.hypot(up, left) < BINS
    assert (image[inside] == 200).all()
    assert (image[~inside] == 0).all()


def test_the_newest_beam_replaces_the_one_before_and_one_of_another_range_begins_a_new_picture():
    picture = PolarImage(SonarImageParameters(metres_per_pixel=1.0))
    picture.draw(beam_of(np.full(BINS, 200)))
    assert picture.draw(beam_of(np.full(BINS, 50)))[20, 50] == 50
    image = picture.draw(beam_of(np.full(2 * BINS, 60), angle=math.pi))
    assert image.shape == (201, 201)
    assert set(np.unique(image)) == {0, 60}


def test_without_a_size_of_pixels_the_range_fits_into_501():
    picture = PolarImage(SonarImageParameters())
    assert picture.draw(beam_of(np.full(BINS, 1), resolution=0.1)).shape == (501, 501)
    assert picture.metres_per_pixel == pytest.approx(5.0 / 250)


def test_a_picture_that_would_be_too_large_is_refused():
    with pytest.raises(RefusedInput, match=r"raise metres_per_pixel, 0\.01 at 50 m"):
        _drawn([0.0], metres_per_pixel=0.01)
