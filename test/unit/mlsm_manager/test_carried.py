"""A current that the odometry did not feel is suspected only where surfaces tell it."""

import numpy as np
import pytest

from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.carried import carried
from mlsm_manager.self_check.scan_pairs import AS_TOLD, ScanPairs

SPEED, TURN, SCANS, ECHOES = 0.3, 15.0, 16, 120  # m/s along x, s, turns of the head, echoes of each
SEEN, WIDTH, NOISE = 15.0, 12.0, 0.1  # m: how far along both walls the sonar hears, between them, and of an echo


def scans_between_walls(reported, across):
    """Return scans of a vehicle whose odometry reports another speed [m/s] after a third of the run.

    across: m between walls that cross the canal; infinity where none do.
    """
    rng, times = np.random.RandomState(1), np.arange(0.0, TURN * SCANS + 1.0)
    along = SPEED * times + (reported - SPEED) * np.maximum(times - times[-1] / 3.0, 0.0)
    track = Track(times, np.column_stack([along, np.zeros((len(times), 2))]))
    scans = []
    for number in range(SCANS):
        stamps = np.sort(rng.uniform(TURN * number, TURN * (number + 1), ECHOES))
        walls = np.column_stack([rng.uniform(-SEEN, SEEN, ECHOES), rng.choice([-WIDTH / 2.0, WIDTH / 2.0], ECHOES)])
        if np.isfinite(across):
            ends = rng.rand(ECHOES) < 0.5
            nearest = across * np.round((walls[ends, 0] + SPEED * stamps[ends]) / across) - SPEED * stamps[ends]
            walls[ends] = np.column_stack([nearest, rng.uniform(-WIDTH / 2.0, WIDTH / 2.0, ends.sum())])
        places = walls + NOISE * rng.normal(size=walls.shape) + track.at(stamps)[:, :2]
        points = np.column_stack([places, np.zeros(ECHOES), np.ones(ECHOES)])
        scans.append(Scan(points, stamps, np.ones(ECHOES, dtype=bool), track, TURN * (number + 1)))
    return scans


@pytest.mark.parametrize(
    ("reported", "across", "is_suspected"),
    [(SPEED, np.inf, False), (SPEED, 20.0, False), (2.0 * SPEED, 20.0, True)],
    ids=["in a canal", "with walls across", "carried, with walls across"],
)
def test_a_current_is_suspected_where_surfaces_face_along_it(reported, across, is_suspected):
    found = carried(ScanPairs(scans_between_walls(reported, across), np.zeros(2)), AS_TOLD)
    assert bool(found) == is_suspected
