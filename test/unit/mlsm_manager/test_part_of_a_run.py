"""A part of a run is fitted as if there had been no other scans."""

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, tour
from made_models import solver_parameters

from mlsm_manager.joint_solver.batch_solver import solved, solved_part
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.normal_equations import DELAY, RUN_COLUMNS

pytestmark = [pytest.mark.long, pytest.mark.newest_only("dear; whole runs are mapped with every version")]
FIRST = 8
SCANS = tour(24, direction=0.12, delay=0.6).scans


def followed(scans):
    solver = LiveSolver(solver_parameters(sonar_delay_deviation=1.0), SONAR_IN_BASE)
    for scan in scans:
        solver.add(scan)
    return solver


@pytest.fixture(scope="module")
def part():
    return solved_part(followed(SCANS), FIRST)


def test_it_finds_what_a_run_of_its_scans_alone_finds(part):
    alone = solved(followed(SCANS[FIRST:]))
    np.testing.assert_allclose(part.run, alone.state.run, atol=0.01)
    np.testing.assert_allclose(part.node[2:], alone.state.nodes[-1, 2:], atol=0.005)
    np.testing.assert_allclose(part.covariance[-RUN_COLUMNS:, -RUN_COLUMNS:], alone.run_covariance, rtol=0.1)


def test_it_knows_the_delay_less_well_than_the_whole_run(part):
    whole = solved(followed(SCANS))
    assert part.covariance[-RUN_COLUMNS:, -RUN_COLUMNS:][DELAY, DELAY] > whole.run_covariance[DELAY, DELAY]
