"""What mlsm_core's parameters allow together."""

from dataclasses import fields

import pytest

from mlsm_manager.localisation.parameters import MlsmCoreParameters
from node_support.parameters import ParameterError


def test_a_user_meets_no_more_parameters_than_fit_on_a_page():
    assert len(fields(MlsmCoreParameters)) - len(MlsmCoreParameters.expert_names()) <= 40


def test_the_default_reserves_the_thesis_basin():
    assert MlsmCoreParameters().expected_blocks == 240 * 100


def test_an_extent_that_no_memory_holds_is_refused():
    with pytest.raises(ParameterError, match=r"size_x_meters = 90000\.0.*at most 16000000 cells"):
        MlsmCoreParameters(size_x_meters=90000.0, size_y_meters=90000.0)


def test_an_extent_may_be_zero():
    assert MlsmCoreParameters(size_x_meters=0, size_y_meters=0).expected_blocks == 0


def test_map_and_odom_must_be_two_frames():
    with pytest.raises(ParameterError, match=r"map_frame = 'odom': must differ from odom_frame"):
        MlsmCoreParameters(map_frame="odom")


def test_parts_of_turns_without_any_heading_are_refused():
    with pytest.raises(ParameterError, match=r"parts_per_turn = 3: must be 1 with odometry = NONE"):
        MlsmCoreParameters(odometry="NONE", parts_per_turn=3)
