"""Where nobody named the odometry, two solvers follow the vehicle, and the echoes tell which of them is right."""

from functools import lru_cache

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, ahead, reporting, tour
from made_models import followed

from mlsm_manager.joint_solver.batch_solver import fit_of
from mlsm_manager.joint_solver.motion_models import SCALE
from mlsm_manager.joint_solver.rival_solvers import Doubt, RivalSolvers, likelier
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.self_check.path_checks import odometry_decided

pytestmark = pytest.mark.long

MADE = tour(16, path=ahead)
AUTO, NAMED = (
    MlsmCoreParameters().changed(profile_values(kind)).solver_parameters()
    for kind in (OdometryKind.AUTO, OdometryKind.DVL)
)


def scans_of(scale):
    """Return the tour's scans with an odometry that reports distances too short by `scale`."""
    return [reporting(scan, 1.0 / (1.0 + scale)) for scan in MADE.scans]


def taken(rivals, scans):
    """Return the estimates after each of `scans`, as shown then."""
    return [rivals.add(scan) for scan in scans]


@lru_cache(maxsize=None)
def run(scale):
    """Return the solvers after the whole tour, and what was shown on the way."""
    rivals = RivalSolvers.begun(AUTO, SONAR_IN_BASE)
    return rivals, taken(rivals, scans_of(scale))


def test_an_odometry_that_is_right_is_taken_for_a_dvl():
    rivals, shown = run(0.0)
    named = followed(MADE.scans, NAMED)
    assert rivals.told.startswith("DVL, ")
    assert rivals.shown.odometry is AUTO.odometry.rival
    for estimate, other in zip(shown[10:], named.estimates[10:]):
        np.testing.assert_allclose(estimate.T_map_base, other.T_map_base, atol=1e-9)
        assert np.trace(estimate.pose_covariance) >= np.trace(other.pose_covariance)


def test_an_odometry_that_is_30_percent_off_is_not():
    rivals, shown = run(0.3)
    assert rivals.told.startswith("THRUSTERS, ")
    assert shown[-1].node[SCALE] == pytest.approx(0.3, abs=0.06)


@pytest.mark.parametrize("scale", [0.0, 0.1, 0.3])
def test_the_stated_deviation_covers_the_error_before_and_after_the_echoes_tell(scale):
    rivals, shown = run(scale)
    start = rivals.shown.log.node_poses(np.array([0]))[0] - MADE.truth.at(0.0)
    for estimate in shown:
        error = estimate.T_map_base - MADE.truth.at(estimate.time) - start
        assert np.hypot(*error[:2]) < 3.0 * estimate.stated_deviation + 0.1


def test_a_model_that_is_out_of_the_question_is_followed_no_more():
    rivals, _ = run(0.6)
    assert rivals.other is None
    assert rivals.told.endswith(", more than 1000 times likelier than DVL")
    assert odometry_decided(rivals.doubt) == ()


def test_a_named_odometry_has_no_rival():
    named = RivalSolvers.begun(NAMED, SONAR_IN_BASE)
    taken(named, MADE.scans[:2])
    assert named.solvers == [named.shown]
    assert named.told == ""


def test_a_stored_run_goes_on_with_both():
    whole, begun = (RivalSolvers.begun(AUTO, SONAR_IN_BASE) for _ in range(2))
    estimates = taken(whole, MADE.scans[:8])
    taken(begun, MADE.scans[:6])
    resumed = RivalSolvers.resumed(AUTO, SONAR_IN_BASE, MADE.scans[:6], begun.stored())
    later = taken(resumed, MADE.scans[6:8])
    np.testing.assert_allclose(later[-1].pose_covariance, estimates[-1].pose_covariance, rtol=1e-6)
    assert resumed.told == whole.told


@pytest.mark.parametrize("scale", [0.0, 0.3])
def test_the_fit_of_a_whole_run_takes_what_all_its_echoes_speak_for(scale):
    rivals = RivalSolvers.begun(AUTO, SONAR_IN_BASE)
    taken(rivals, scans_of(scale))
    rivals.show_other()  # what is wrong
    fit = rivals.believed([fit_of(solver.solution) for solver in rivals.solvers])
    assert fit.state.nodes[-1, SCALE] == pytest.approx(scale, abs=0.05)
    assert fit.state.nodes.shape[1] == rivals.shown.odometry.width


def test_a_scale_that_does_not_change_is_the_same_all_along_a_fit():
    scales = fit_of(run(0.3)[0].shown.solution).state.nodes[:, SCALE]
    assert np.ptp(scales) < 1e-6


@pytest.mark.parametrize(("deviation", "fires"), [(0.5, False), (2.4, False), (2.6, True)])
def test_the_check_fires_where_the_other_odometry_is_the_largest_doubt(deviation, fires):
    (verdict,) = odometry_decided(Doubt("DVL, 3 times likelier than THRUSTERS", "THRUSTERS", 4.0, deviation, own=2.5))
    assert verdict.fires == fires
    assert "(DVL, 3 times likelier than THRUSTERS; with THRUSTERS it is 4.0 m elsewhere, " in verdict.text


@pytest.mark.parametrize(
    ("lead", "told"),
    [
        (4.4, "one, 80 times likelier than two"),
        (-1.1, "two, 3 times likelier than one"),
        (0.1, "one, hardly likelier than two"),
        (12.0, "one, more than 1000 times likelier than two"),
    ],
)
def test_how_much_likelier_an_odometry_is_is_told_without_logarithms(lead, told):
    assert likelier("one", lead, "two") == told
