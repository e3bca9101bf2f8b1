"""Recordings are corrected and given to the localiser scan by scan; what cannot be used is left out, and counted."""

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
from sonar_processing.beams.parameters import BeamCorrection

TIMES = np.arange(0.0, 11.0)
TURNING = Track(TIMES, np.column_stack([0.5 * TIMES, 0.1 * TIMES, 0.2 * TIMES]))
T_BASE_SONAR = matrices(np.array([0.3, 0.0, np.pi]))
T_BASE_SONAR[2, 3] = -0.2


def taken(seconds):
    """Return what a sonar ahead of and below base_link hears at a time."""
    beam = Beam(round(seconds * 1e9), "sonar", 0.4, np.arange(5, dtype=np.uint8), 0.1)
    return PlacedBeam(beam, matrices(TURNING.at(seconds)) @ T_BASE_SONAR, True)


@pytest.fixture
def recording():
    return Recording([taken(seconds) for seconds in (1.0, 5.0, 9.5)], 2, TURNING, None)


def test_nothing_wrong_changes_nothing(recording):
    assert recording.corrected(BeamCorrection()) is recording


@pytest.mark.parametrize("delay", [0.75, -0.9])
def test_beams_are_placed_where_the_vehicle_was_at_their_true_time(recording, delay):
    found = recording.corrected(BeamCorrection(sonar_delay=delay)).beams
    for placed, seconds in zip(found, (1.0, 5.0)):
        assert placed.beam.stamp_ns == round((seconds + delay) * 1e9)
        np.testing.assert_allclose(placed.T_target_sonar, taken(seconds + delay).T_target_sonar, atol=1e-12)


def test_ranges_are_scaled_from_the_sonar(recording):
    found = recording.corrected(BeamCorrection(range_scale=0.9))
    assert [placed.beam.range_resolution for placed in found.beams] == pytest.approx([0.09] * 3)
    np.testing.assert_allclose(found.beams[1].T_target_sonar, recording.beams[1].T_target_sonar, atol=1e-12)


def test_beams_beyond_the_odometry_count_as_unplaced(recording):
    found = recording.corrected(BeamCorrection(sonar_delay=1.0))
    assert (len(found.beams), found.unplaced) == (2, 3)


def test_a_planar_pose_as_a_matrix_keeps_height_and_level():
    found = matrices(np.array([[1.0, 2.0, np.pi / 2.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(found[0] @ [3.0, 0.0, 7.0, 1.0], [1.0, 5.0, 7.0, 1.0], atol=1e-12)
    np.testing.assert_array_equal(found[1], np.eye(4))


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
