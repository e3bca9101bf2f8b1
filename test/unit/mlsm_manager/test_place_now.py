"""How well a position is known, and what speaks against it, in words."""

from dataclasses import replace

import numpy as np
import pytest

from mlsm_manager.localisation.place_now import PlaceNow, PositionState, doubts_of, position_state, report_place
from mlsm_manager.offline.findings import BestPath
from mlsm_manager.self_check.causes import UNTOLD_ALONE, Cause
from mlsm_manager.self_check.verdict import Verdict
from node_support.health import Health, Level


def known_to(variance, by_mounts=0.0):
    return PlaceNow(100.0, 10.0, 0.0, variance * np.eye(3), 7, by_mounts)


DOUBT = ["two submaps"]


def test_the_first_fixes_are_provisional_and_what_they_leave_open_is_no_problem():
    states = [position_state(known_to(0.1)._replace(fixes=fixes), False, False, [], "")[0] for fixes in (6, 7)]
    assert states == [PositionState.PROVISIONAL, PositionState.GOOD]
    health = Health("mlsm_core", lambda line: None)
    for fixes, level in ((2, Level.OK), (3, Level.ERROR)):
        report_place(health, known_to(18.0)._replace(fixes=fixes))
        assert health.report().level is level


@pytest.mark.parametrize(
    ("place", "is_lost", "is_provisional", "doubts", "state", "told"),
    [
        (known_to(0.08), False, False, [], PositionState.GOOD, "position good, 0.4 m"),
        (known_to(0.08), False, True, [], PositionState.PROVISIONAL, "position provisional: no two scans agree yet"),
        (known_to(0.08), False, True, DOUBT, PositionState.DOUBTFUL, "position doubtful, 0.4 m: two submaps"),
        (known_to(13.0), False, False, DOUBT, PositionState.UNKNOWN, "position not known, 5.1 m; two submaps"),
        (known_to(18.0, 5.0), False, False, [], PositionState.GOOD, "position good, 6.0 m (3.3 m in the map)"),
        (known_to(18.0, 2.0), False, False, [], PositionState.UNKNOWN, "position not known, 5.7 m"),
        (known_to(0.08), True, False, [], PositionState.UNKNOWN, "position lost: it is searched for in the whole map"),
        (None, False, True, DOUBT, PositionState.UNKNOWN, "no position yet; two submaps"),
    ],
)
def test_a_position_is_good_only_where_nothing_speaks_against_it(place, is_lost, is_provisional, doubts, state, told):
    assert position_state(place, is_lost, is_provisional, doubts, "") == (state, told)


def test_a_good_position_tells_on_what_it_rests_though_nobody_measured_it():
    _, told = position_state(known_to(0.08), False, False, [], UNTOLD_ALONE)
    assert told == f"position good, 0.4 m; {UNTOLD_ALONE}"


JUMP = Cause("odometry jumped by 30.0 m", 1e3, 88.0, is_mended=True, metres=0.5)
TURNED = Cause("the sonar is turned by 20 deg", 40.0)
ODOMETRY = "tf of odom -> base_link"
SMEARED = Verdict("scans on the map", 0.2, 0.5, "scans beside the map", more_is_better=True)


@pytest.mark.parametrize(
    ("overdue", "causes", "verdicts", "silent", "said"),
    [
        (0.0, [], [], {}, []),
        (0.0, [JUMP], [], {}, ["odometry jumped by 30.0 m 12 s ago"]),
        (0.0, [Cause("the head stood for 29 s,", 500.0, 88.0)], [], {}, ["the head stood for 29 s, 12 s ago"]),
        (0.0, [replace(JUMP, begin=20.0)], [], {}, []),
        (0.0, [TURNED], [SMEARED], {}, [TURNED.text, SMEARED.text]),
        (3.0, [TURNED], [], {}, ["no fix for 30 s", TURNED.text]),
        (3.0, [], [], {"/sonar/raw": 28.0}, ["sonar silent for 28 s (nothing on /sonar/raw)"]),
        (None, [], [], {ODOMETRY: 12.0}, [f"odometry silent for 12 s (nothing on {ODOMETRY})"]),
    ],
)
def test_what_speaks_against_a_position_is_said_the_worst_first(overdue, causes, verdicts, silent, said):
    place = None if overdue is None else PlaceNow(100.0, 30.0, overdue, np.eye(3), 5)
    doubts = doubts_of(place, causes, verdicts, silent, ODOMETRY)
    assert doubts == said
    assert all(doubt in position_state(place, False, False, doubts, "")[1] for doubt in said)


def test_where_fixes_ended_the_last_place_is_known_no_better_than_that_of_the_last_scan():
    nowhere = np.zeros((1, 2))
    path = BestPath(np.zeros((2, 3)), None, np.array([90.0]), nowhere, 4.0 * np.eye(2)[np.newaxis], np.zeros(1))
    end = known_to(1.0)._replace(covariance=np.diag([1.0, 9.0, 1.0]))
    ended = path.to_the_end(end, np.diag([2.0, 4.0]))
    np.testing.assert_allclose(ended.covariances, [np.diag([4.0, 4.0]), np.diag([4.0, 9.0])])
    assert ended.times.tolist() == [90.0, 100.0]
