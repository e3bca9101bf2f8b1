"""A Tritech Micron in a rectangular tank: cleaned clouds make four straight walls and no ring around the head."""

import numpy as np
import pytest

from mlsm_manager.offline.recording import read_recording
from mlsm_manager.offline.thesis_chain import ThesisChain
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from recordings.reader import Request

RINGING = 0.4
# Where each wall is (axis, position [m]) and along which part of it [m] nothing else stands.
WALLS = {
    "left": (0, -4.1, (-0.2, 1.4)),
    "right": (0, 4.1, (-1.0, 3.0)),
    "far": (1, 2.2, (-2.5, 2.0)),
    "near": (1, -1.0, (-1.0, 1.5)),
}
BAND = 0.8
PULSE = 0.25


@pytest.fixture(scope="module")
def places(recording):
    """Return x, y (n, 2) of the blocks of a map of all whole scans, cleaned as the nodes do by default."""
    chain = ThesisChain.from_values({"sonar_to_cloud": {"scan_size": 200}})
    tank = MultiLevelSurfaceMap(0.1)
    for scan, _ in chain.scans(read_recording(recording("micron_static.bag"), Request())):
        tank.insert(scan.points)
    return tank.blocks.mean[:, :2]


@pytest.mark.parametrize("name", WALLS)
def test_blocks_along_each_wall_scatter_about_a_line_by_no_more_than_the_length_of_the_pulse(places, name):
    axis, position, (first, last) = WALLS[name]
    across, along = places[:, axis], places[:, 1 - axis]
    on_wall = (np.abs(across - position) < BAND) & (along > first) & (along < last)
    assert np.count_nonzero(on_wall) > 30
    assert np.diff(np.sort(np.concatenate([[first], along[on_wall], [last]]))).max() < 0.5
    slope, offset = np.polyfit(along[on_wall], across[on_wall], 1)
    assert (across[on_wall] - slope * along[on_wall] - offset).std() < PULSE
    assert abs(slope) < np.tan(np.radians(10.0))
    assert abs(offset - position) < 0.4


def test_nothing_is_drawn_where_only_the_head_s_own_ringing_is_heard(places):
    assert np.linalg.norm(places, axis=1).min() > RINGING
