"""Stamps and ranges of beams put right."""

import numpy as np
import pytest

from node_support.errors import RefusedInput
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.parameters import BeamCorrection

BEAM = Beam(5_000_000_001, "sonar", 0.1, np.arange(4, dtype=np.uint8), 0.5)


def test_nothing_wrong_changes_nothing():
    assert BeamCorrection().corrected(BEAM) == BEAM


def test_the_delay_is_added_to_the_nanosecond():
    assert BeamCorrection(sonar_delay=0.25).corrected(BEAM).stamp_ns == 5_250_000_001
    assert BeamCorrection(sonar_delay=-5.0).corrected(BEAM).stamp_ns == 1


def test_ranges_are_scaled():
    np.testing.assert_allclose(BeamCorrection(range_scale=0.9).corrected(BEAM).ranges, 0.9 * BEAM.ranges)


def test_the_rest_of_the_beam_stays():
    found = BeamCorrection(1.0, 1.1).corrected(BEAM)
    assert (found.frame_id, found.angle, found.sensor_angle) == (BEAM.frame_id, BEAM.angle, BEAM.sensor_angle)
    np.testing.assert_array_equal(found.intensities, BEAM.intensities)


def test_a_beam_before_time_0_is_refused():
    with pytest.raises(RefusedInput, match=r"stamp -5\.000 s, below 0; check sonar_delay"):
        BeamCorrection(sonar_delay=-10.0).corrected(BEAM)
