"""What a run found out reaches the next one, in the sonar's own terms."""

import numpy as np
import pytest
import yaml

from mlsm_manager.offline.findings import Calibration
from mlsm_manager.offline.replay_parameters import ReplayParameters, live_text, replay_values

NAMES = ("range_scale_error", "sonar_delay", "odometry_scale", "odometry_direction")
FOUND = Calibration(NAMES, np.array([0.02, 0.5, 0.01, -0.07]), np.array([0.008, 0.05, 0.009, 0.03]))


def test_it_is_told_by_name_with_its_deviation():
    told = FOUND.to_mapping()
    assert tuple(told) == NAMES
    assert told["sonar_delay"] == {"value": 0.5, "deviation": 0.05}


def test_live_yaml_holds_it_on_top_of_what_was_set_before():
    before = ReplayParameters(range_scale=0.9, sonar_delay=0.25)
    text = live_text(FOUND.applied(before), "odom", "base_link")
    after = ReplayParameters.from_mapping(replay_values(yaml.safe_load(text))[0])
    assert (after.range_scale, after.sonar_delay) == (pytest.approx(0.918), pytest.approx(0.75))
    assert (after.range_scale_deviation, after.sonar_delay_deviation) == (0.008, 0.05)
    assert (after.odometry_scale, after.odometry_direction) == (0.01, -0.07)


def test_a_run_that_went_astray_is_told_within_what_parameters_allow():
    astray = Calibration(NAMES, np.array([9.0, -99.0, 0.0, 9.0]), np.full(4, 9.0))
    after = astray.applied(ReplayParameters())
    assert (after.range_scale, after.sonar_delay, after.odometry_direction) == (2.0, -10.0, 3.2)
