"""What a recording and map_bag's command line say of echoes, motion and odometry, and the profiles."""

import re

import numpy as np
import pytest
import yaml

from dead_reckoning.dead_reckoner import DeadReckoningParameters
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.localisation.updates import report_turn
from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import ReplayParameters, replay_values
from mlsm_manager.offline.suited_parameters import odometry_of, with_cells, with_odometry
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.files import package_folder
from node_support.health import Health
from recordings.motion.sweep_shifts import SweepMotion
from recordings.motion.vehicle_motion import MotionSource

TIMES = np.linspace(0.0, 100.0, 50)


def profile(kind):
    return (package_folder() / f"yaml/odometry_{kind.value.lower()}.yaml").read_text()


def track(x=0.0, y=0.0, yaw=0.0):
    return Track(TIMES, np.column_stack([np.full(50, x), np.full(50, y), np.full(50, yaw)]))


@pytest.mark.parametrize(
    ("reported", "kind"),
    [
        (track(x=TIMES), OdometryKind.AUTO),
        (track(x=TIMES, yaw=TIMES / 50.0), OdometryKind.AUTO),
        (track(x=3.0, yaw=np.sin(TIMES)), OdometryKind.HEADING),
        (track(x=1e-3 * np.sin(TIMES), yaw=np.sin(TIMES)), OdometryKind.HEADING),
    ],
)
def test_what_changes_tells_the_odometry(reported, kind):
    assert odometry_of(Recording([], 0, reported, None)).kind is kind


def test_a_pose_that_never_changes_is_held_unless_sweeps_show_a_motion():
    standing = odometry_of(Recording([], 0, track(x=3.0, y=1.0, yaw=0.4), None))
    assert (standing.name, standing.motion) == ("not told, held still", SweepMotion.UNTOLD)
    assert "nothing tells" in standing.assumed.text
    held, seems_still, drifting, moving = (
        with_odometry(ReplayParameters(), standing.kind, (), motion)
        for motion in (SweepMotion.UNTOLD, SweepMotion.STILL, SweepMotion.DRIFTING, SweepMotion.MOVING)
    )
    assert moving.slip_deviation > profile_values(OdometryKind.NONE)["slip_deviation"]
    assert held.speed_deviation < 1e-3 < seems_still.speed_deviation < drifting.speed_deviation


def test_a_vehicle_of_which_somebody_says_that_it_stood_is_held_even_where_echoes_tell_it_too():
    said = odometry_of(Recording([], 0, track(x=3.0, y=1.0, yaw=0.4), None), standing=True)
    held = with_odometry(ReplayParameters(), said.kind, (), said.motion, said.is_said)
    assert held.speed_deviation < 1e-3


@pytest.mark.parametrize("kind", list(OdometryKind))
def test_every_profile_is_allowed_live_and_on_recordings(kind):
    live = yaml.safe_load(profile(kind))
    assert MlsmCoreParameters.from_mapping(live["mlsm_core"]).odometry is kind
    assert with_odometry(ReplayParameters(), kind, ()) == ReplayParameters.from_mapping(replay_values(live)[0])


@pytest.mark.parametrize("kind", list(OdometryKind))
def test_every_value_of_a_profile_has_a_reason(kind):
    lines = [line.strip() for line in profile(kind).splitlines()]
    told = [(before, line) for before, line in zip(lines, lines[1:]) if not line.endswith(":") and line[0] != "#"]
    assert [line for before, line in told if before[0] != "#"] == [f"odometry: {kind.value}"]


def test_the_defaults_on_recordings_are_the_profile_of_a_dvl():
    assert with_odometry(ReplayParameters(), OdometryKind.AUTO, ()) == ReplayParameters()


def test_what_a_person_set_is_not_changed_by_a_profile():
    mine = ReplayParameters(slip_deviation=0.4)
    chosen = with_odometry(mine, OdometryKind.HEADING, {"slip_deviation"})
    assert chosen.slip_deviation == 0.4
    assert chosen.speed_deviation == profile_values(OdometryKind.HEADING)["speed_deviation"]


@pytest.mark.parametrize(("kind", "slow"), [("DVL", False), ("THRUSTERS", False), ("HEADING", True), ("NONE", True)])
def test_a_turn_of_a_minute_is_too_slow_where_no_speed_is_measured(kind, slow):
    """A Ping360 with 400 beams over a serial line takes nearly as long."""
    parameters = with_odometry(ReplayParameters(), OdometryKind(kind), ())
    warnings = []
    for seconds in (16.0, 60.0):
        health = Health("mlsm_core", warnings.append)
        report_turn(health, seconds, parameters.longest_turn)
    assert ["60 s, must be at most 40 s" in line for line in warnings] == [True] * slow


@pytest.mark.parametrize("kind", [OdometryKind.HEADING, OdometryKind.HOVERING])
def test_a_velocity_that_is_not_estimated_any_more_fades_as_fast_as_the_profile_lets_speeds_change(kind):
    live = yaml.safe_load(profile(kind))
    assert (
        DeadReckoningParameters(**live["dead_reckoning"]).velocity_fading
        == profile_values(kind)["rate_correlation_time"]
    )


@pytest.mark.parametrize(
    ("reach", "fixed", "cell"), [(45.0, (), 0.5), (8.0, (), 0.2), (1.0, (), 0.05), (8.0, ("resolution",), 0.5)]
)
def test_near_echoes_make_small_cells(reach, fixed, cell):
    """The vehicle has gone 5 m when it hears them."""
    points = np.column_stack([np.full(100, 5.0 + reach), np.zeros((100, 3))])
    scan = Scan.from_stamps(points, np.full(100, 5.0), 5.0, track(x=TIMES))
    assert with_cells(ReplayParameters(), [scan], fixed).resolution == pytest.approx(cell)


def command_line(*words):
    return map_bag_arguments(["a.bag", "--out", "out", *words])


@pytest.mark.parametrize(
    ("words", "declared", "odometry"),
    [
        ("--unknown-motion", MotionSource.UNKNOWN, OdometryKind.NONE),
        ("--unknown-motion --odometry none", MotionSource.UNKNOWN, OdometryKind.NONE),
        ("--standing", MotionSource.STANDING, None),
    ],
)
def test_an_unknown_motion_means_no_odometry_and_standing_leaves_it_to_the_recording(words, declared, odometry):
    options = command_line(*words.split())
    assert (options.request.motion.declared, options.odometry) == (declared, odometry)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("--standing --odometry none", "did not move.* give --unknown-motion instead$"),
        ("--unknown-motion --odometry heading", "--odometry heading: must be none, or left out, with --unknown-motion"),
        ("--standing --unknown-motion", "not allowed with argument --standing"),
    ],
)
def test_motions_that_contradict_each_other_are_refused(capsys, words, reason):
    with pytest.raises(SystemExit) as ended:
        command_line(*words.split())
    assert ended.value.code == 2
    assert re.search(reason, capsys.readouterr().err.splitlines()[-1])
