"""Where piers repeat, a compass alone does not tell how far the vehicle went: other places are tried and stated."""

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from benchmarks.faults import source
from benchmarks.harness import mapped_as

pytestmark = pytest.mark.long

NAMED = ("--odometry", "heading")  # to try whether the vehicle strafes as well would take longest


def mapped(share, seconds):
    """Return what is mapped of a tour along piers, of which a share of the range is heard at first."""
    recording = source("harbour compass", seconds)
    return mapped_as(broken.range_told(recording, 0.0, share, 300.0), "--refine", *NAMED)


def test_where_piers_repeat_the_likeliest_place_is_taken_and_another_one_is_stated():
    found = mapped(0.449, 400.0)
    trust, truth = found.findings.trust, found.recording.truth
    apart = found.run.best[:, :2] - np.column_stack(
        [np.interp(found.run.times, truth.times, axis) for axis in truth.positions.T]
    )
    off = np.hypot(*(apart - apart[0]).T)
    assert off.mean() < 1.0  # m; it was 2.3 at the place that was found first
    assert trust.causes[-1].text.startswith("echoes fit nearly as well with the vehicle ")
    assert (off < 2.5 * np.interp(found.run.times, trust.times, trust.deviations) + 0.5).all()
    assert np.median(trust.deviations) > 2.0


def test_a_run_that_hears_far_enough_fits_nowhere_else():
    assert mapped(1.0, 250.0).findings.trust.causes == []
