"""Each fault of the bench breaks a recording that can still be mapped."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.fault_rows import faults
from made_recordings import SECONDS, touring

from mlsm_manager.offline.recording import Recording

# Every fifth beam, with its pose: faults take beam by beam.
WHOLE = replace(touring(), beams=touring().beams[::5])
FAULTS = {name: make for name, (_, make) in faults(SECONDS).items() if name != "nothing"}


def _figures(beam):
    return np.array([beam.stamp_ns * 1e-9, beam.angle, beam.intensities.size, beam.range_resolution])


def content(recording: Recording):
    """Return all that a fault may change, as one array."""
    parts = [_figures(one.beam) for one in recording.beams]
    parts += [np.concatenate([one.T_target_sonar.ravel(), one.beam.intensities]) for one in recording.beams]
    return np.concatenate([recording.track.poses.ravel(), *parts])


@pytest.mark.parametrize("name", FAULTS)
def test_it_changes_the_recording_and_leaves_the_original(name):
    before = content(WHOLE)
    broken, again = FAULTS[name](WHOLE), FAULTS[name](WHOLE)
    assert not np.array_equal(content(broken), before)
    assert np.array_equal(content(broken), content(again))
    assert np.array_equal(content(WHOLE), before)
    assert np.isfinite(content(broken)).all()


def test_a_seed_draws_other_sizes_and_times():
    usual, drawn, again = (faults(SECONDS, seed) for seed in (None, 1, 1))
    assert list(drawn) == list(again)
    assert len(drawn) == len(usual) == len(set(drawn))
    assert not {name for name in drawn if " at " in name} & set(usual)
