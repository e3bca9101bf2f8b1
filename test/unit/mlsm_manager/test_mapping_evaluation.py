"""Errors against a truth."""

import numpy as np
import pytest

from mlsm_manager.offline.recording import Truth
from mlsm_manager.offline.run_files import position_error
from recordings.bags.bag import RecordingError

TIMES = np.arange(0.0, 11.0)
AHEAD = np.column_stack([TIMES, np.zeros(11)])


def test_a_shifted_truth_is_no_error():
    error = position_error(TIMES, AHEAD, Truth(TIMES, AHEAD + np.array([100.0, -50.0])))
    assert (error.mean, error.max) == (0.0, 0.0)


def test_a_turned_truth_is_an_error():
    error = position_error(TIMES, AHEAD, Truth(TIMES, AHEAD[:, ::-1]))
    assert error.max == pytest.approx(10.0 * np.sqrt(2.0))


def test_distances_count_at_the_stamps_of_the_truth():
    error = position_error(TIMES, AHEAD, Truth(np.array([0.0, 2.5, 7.5]), np.array([[0.0, 0], [2.5, 3.0], [7.5, 0.0]])))
    assert (error.mean, error.max, error.sd) == pytest.approx((1.0, 3.0, np.sqrt(2.0)))


def test_the_truth_beyond_the_odometry_does_not_count():
    late = Truth(np.array([5.0, 10.0, 20.0]), np.array([[5.0, 0.0], [10.0, 0.0], [99.0, 0.0]]))
    assert position_error(TIMES, AHEAD, late).max == 0.0


def test_a_truth_of_another_time_is_refused():
    with pytest.raises(RecordingError, match="no time in common"):
        position_error(TIMES, AHEAD, Truth(TIMES + 100.0, AHEAD))
