"""Lists of dataclasses as arrays."""

from dataclasses import dataclass

import numpy as np
import pytest

from mlsm_manager.joint_solver.estimate import stacked, unstacked


@dataclass(frozen=True)
class Drift:
    values: np.ndarray


@dataclass(frozen=True)
class Estimate:
    time: float
    count: int
    place: np.ndarray
    drift: Drift


ESTIMATES = [Estimate(0.5 * number, number, np.arange(3.0) + number, Drift(np.eye(2) * number)) for number in range(4)]


def test_what_was_stacked_comes_back():
    again = unstacked(Estimate, stacked(ESTIMATES, "a."), "a.")
    assert [(one.time, one.count) for one in again] == [(one.time, one.count) for one in ESTIMATES]
    for one, other in zip(again, ESTIMATES):
        np.testing.assert_array_equal(one.place, other.place)
        np.testing.assert_array_equal(one.drift.values, other.drift.values)


def test_nothing_comes_back_as_nothing():
    assert unstacked(Estimate, stacked([], "a."), "a.") == []


def test_a_field_that_is_missing_or_of_another_length_is_refused():
    arrays = stacked(ESTIMATES)
    with pytest.raises(ValueError, match="elements"):
        unstacked(Estimate, {**arrays, "time": arrays["time"][:2]})
    with pytest.raises(KeyError, match="place"):
        unstacked(Estimate, {name: array for name, array in arrays.items() if name != "place"})
