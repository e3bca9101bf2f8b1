"""A recording is given to the localiser scan by scan; what cannot be used is left out, and counted."""

from dataclasses import replace

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, tour

from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import replay
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import composed, matrices
from sonar_processing.beams.beam import Beam, PlacedBeam

DAMAGED = 5


@pytest.fixture(scope="module")
def made():
    return tour(10)


def recording_of(made):
    beam = Beam(0, "sonar", 0.0, np.zeros(1, dtype=np.uint8), 1.0)
    mounting = matrices(composed(made.odometry.poses[0], np.append(SONAR_IN_BASE, 0.0))[np.newaxis])[0]
    return Recording([PlacedBeam(beam, mounting, False)], 0, made.odometry, None)


def with_wild_odometry(scan):
    poses = scan.track.poses.copy()
    poses[::2] = 1e200
    return replace(scan, track=Track(scan.track.times, poses))


def replayed(made, scans):
    return replay(recording_of(made), scans, ReplayParameters(), lambda _: None)


def test_a_scan_without_a_solution_is_left_out_and_counted(made):
    scans = [*made.scans[:DAMAGED], with_wild_odometry(made.scans[DAMAGED]), *made.scans[DAMAGED + 1 :]]
    found = replayed(made, scans)
    assert found.refused == {"scans without a solution": 1}
    assert len(found.scans) == len(scans) - 1
    assert np.isfinite(found.corrected).all()


def test_a_scan_that_is_left_out_changes_nothing_else(made):
    rest = [*made.scans[:DAMAGED], *made.scans[DAMAGED + 1 :]]
    damaged = [*made.scans[:DAMAGED], with_wild_odometry(made.scans[DAMAGED]), *made.scans[DAMAGED + 1 :]]
    found, expected = replayed(made, damaged), replayed(made, rest)
    np.testing.assert_allclose(found.corrected, expected.corrected, rtol=0.0, atol=1e-9)
