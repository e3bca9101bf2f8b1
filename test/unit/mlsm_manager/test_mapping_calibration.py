"""What a recording tells of its sonar: beam width, delay of the stamps, scale of the ranges."""

import numpy as np
import pytest
from made_corridor import heard, path

from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.offline.beam_width_calibration import half_width_of
from mlsm_manager.offline.calibration import Calibrator, Estimate, calibrated
from mlsm_manager.offline.replay_parameters import ReplayParameters
from sonar_processing.filters.echo_extraction import ExtractionMode

PARAMETERS = ReplayParameters(range_scale_deviation=0.0)


def calibrator():
    return Calibrator(PARAMETERS.build_matcher(), PARAMETERS.part(OdometryErrors), 1.0)


@pytest.mark.parametrize("half_width", [0.045, 0.075])
def test_the_width_of_the_beam_is_what_makes_the_walls_straight(half_width):
    assert half_width_of(heard(path(), half_width=half_width)) == pytest.approx(half_width, abs=0.02)


def test_a_narrow_beam_is_left_alone():
    assert half_width_of(heard(path())) == 0.0


def test_the_delay_of_the_stamps_shows_where_the_vehicle_turns():
    found = calibrator().delay(heard(path(), delay=0.8, wander=0.03))
    assert found.value == pytest.approx(0.8, abs=0.1)
    assert found.deviation < 0.1


def test_the_scale_of_the_ranges_shows_along_the_way():
    found = calibrator().scale(heard(path(), range_scale=0.95, wander=0.03))
    assert found.value == pytest.approx(1.0 / 0.95 - 1.0, abs=3.0 * found.deviation)
    assert found.deviation < 0.03


def test_what_is_held_stays():
    scans = heard(path(120.0), half_width=0.06, delay=0.8)
    names = ("sonar_delay", "range_scale", "edge_half_width")
    assert calibrated(scans, PARAMETERS, names) == PARAMETERS


def test_too_few_scans_change_nothing():
    found = calibrated(heard(path(60.0), delay=0.8, half_width=0.06), PARAMETERS, ())
    assert found.sensor_model().to_mapping() == {"sonar_delay": 0.0, "range_scale": 1.0, "edge_half_width": 0.0}


def test_only_leading_edges_are_turned():
    scans = heard(path(), half_width=0.06)
    fixed = ("sonar_delay", "range_scale")
    edges = PARAMETERS.changed({"mode": ExtractionMode.LEADING_EDGE})
    assert calibrated(scans, edges, fixed).edge_half_width == pytest.approx(0.06, abs=0.02)
    assert calibrated(scans, PARAMETERS, fixed).edge_half_width == 0.0


def test_an_odometry_that_no_speed_of_sound_explains_is_contradicted():
    assert calibrator().contradicts(Estimate(0.3, 0.05, 20))
    assert not calibrator().contradicts(Estimate(0.054, 0.028, 20))
    assert not calibrator().contradicts(Estimate(0.3, 0.05, 3))


def test_an_estimate_is_drawn_to_zero_as_far_as_it_is_uncertain():
    assert Estimate(0.5, 0.01, 20).shrunk(1.0) == pytest.approx(0.5, rel=1e-3)
    assert Estimate(0.5, 1.0, 20).shrunk(1.0) == pytest.approx(0.25)
    assert Estimate(0.5, np.inf, 0).shrunk(1.0) == 0.0
