"""The marina with an IMU and the velocities of a DVL instead of positions."""

import numpy as np

from mlsm_manager.offline.recording import read_recording
from recordings.reader import Request


def test_velocities_and_headings_make_the_way_that_the_vehicle_itself_reckoned(recording):
    """They were made of the positions, so that nothing but the moments of their samples differs in 235 m."""
    reckoned, recorded = (
        read_recording(recording(name), Request()).track for name in ("marina_first_dvl.bag", "marina_first.bag")
    )
    times = np.linspace(max(reckoned.times[0], recorded.times[0]), min(reckoned.times[-1], recorded.times[-1]), 500)
    ways = [track.at(times)[:, :2] - track.at(times[:1])[:, :2] for track in (reckoned, recorded)]
    assert np.linalg.norm(ways[0] - ways[1], axis=1).max() < 0.1
