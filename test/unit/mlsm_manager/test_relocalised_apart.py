"""A vehicle that lies apart from the map after a silence is looked for in the map, not among what it heard since."""

import numpy as np
import pytest
from made_compass import with_heading_only
from made_harbour import SONAR_IN_BASE, TURN, ahead, tour

from mlsm_manager.localisation.clouds import Cloud
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import MlsmCoreParameters

pytestmark = pytest.mark.long
HEARD, SILENT, AFTER = 10, 5, 3
CARRIED = 150.0
"""s: the vehicle is carried in the silence to where it would have been so much later, farther than it goes itself."""


def carried(times):
    """Return the poses (m, 3) at `times` (m,)."""
    return ahead(np.where(times > (HEARD + 1.5) * TURN, times + CARRIED, times))


class Run:
    """localiser: after the tour. expected: (3,) where the vehicle is. blocks: of the map before the silence."""

    def __init__(self):
        made = tour(HEARD + SILENT + AFTER, path=carried)
        profile = {**profile_values(OdometryKind.HEADING), "start_matching": True}
        self.localiser = MlsmCoreParameters().changed(profile).build_localiser(SONAR_IN_BASE)
        self.take(made.scans[:HEARD])
        self.blocks = self.localiser.blocks
        self.take(made.scans[-AFTER:])
        begin, end = made.truth.at(np.array([0.0, made.scans[-1].reference_time]))
        self.expected = end - begin * [1.0, 1.0, 0.0]

    def take(self, scans):
        """Give scans, and clouds of the same echoes, to the localiser."""
        for scan in scans:
            scan = with_heading_only(scan)
            self.localiser.take_scan(scan)
            self.localiser.take_cloud(Cloud.of_scan(scan))


@pytest.fixture(scope="module")
def run():
    return Run()


def far_from(blocks, others):
    """Return how many of `blocks` are more than 2 m from all `others`."""
    distance = np.linalg.norm(blocks.mean[:, np.newaxis, :2] - others.mean[:, :2], axis=-1)
    return int((distance.min(axis=1) > 2.0).sum())


def test_1_what_it_hears_after_the_silence_lies_apart(run):
    assert far_from(run.localiser.blocks, run.blocks) > 50


def test_2_it_is_found_in_the_map_from_before(run):
    found = run.localiser.relocalise()
    assert found.accepted
    assert found.forgotten == AFTER
    np.testing.assert_allclose(found.result.pose[:2], run.expected[:2], atol=0.3)


def test_3_what_lay_apart_is_not_in_the_map_any_more(run):
    assert far_from(run.localiser.blocks, run.blocks) == 0
