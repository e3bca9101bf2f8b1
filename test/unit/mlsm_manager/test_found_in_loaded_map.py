"""A vehicle in a loaded map hears nothing for a while, and then a part of the map that its own run never heard."""

import numpy as np
import pytest
from made_compass import PARAMETERS, with_heading_only
from made_harbour import HARBOUR, SONAR_IN_BASE, ahead, tour

from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.scan_matching.scan import Scan

HEARD, SILENT, AFTER = 6, 8, 2
EDGE = 5.0
"""m: before the silence the sonar hears what is west of it, afterwards what is east of it."""


def run(known):
    """Return the session and the true path; known: (n, 2) m, blocks of the map that the run begins in."""
    made = tour(HEARD + SILENT + AFTER, path=ahead)
    first = made.truth.at(np.zeros(1))[0] * [1.0, 1.0, 0.0]
    session = JointSession.begun(PARAMETERS, SONAR_IN_BASE, first, np.array([0.3, 0.3, 0.02]), known)
    for scan in made.scans[:HEARD]:
        session.add(with_heading_only(selected(scan, scan.points[:, 0] < EDGE)))
    for scan in made.scans[-AFTER:]:
        session.add(with_heading_only(selected(scan, scan.points[:, 0] > EDGE)))
    return session, made.truth


def selected(scan, rows):
    return Scan(scan.points[rows], scan.times[rows], scan.moving[rows], scan.track, scan.reference_time)


def blocks_of(corners, spacing=0.5):
    """Return points (n, 2) along the walls between `corners` (k, 2)."""
    sides = np.roll(corners, -1, axis=0) - corners
    steps = [np.arange(0.0, 1.0, spacing / np.hypot(*side))[:, np.newaxis] for side in sides]
    return np.concatenate([corner + step * side for corner, step, side in zip(corners, steps, sides)])


@pytest.fixture(scope="module")
def loaded():
    return run(blocks_of(HARBOUR))


def test_the_vehicle_is_found_where_only_the_loaded_map_was_heard(loaded):
    session, _ = loaded
    assert not session.solver.islands.is_apart


def test_it_is_found_at_the_right_place(loaded):
    session, truth = loaded
    path = session.path(session.solver.log.node_times[-AFTER:])
    assert np.hypot(*(path - truth.at(session.solver.log.node_times[-AFTER:]))[:, :2].T).max() < 1.0


def test_without_the_loaded_map_its_place_is_unknown():
    session, _ = run(np.empty((0, 2)))
    assert session.solver.islands.is_apart
