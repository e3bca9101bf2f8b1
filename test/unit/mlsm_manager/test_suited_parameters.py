"""What a recording and map_bag's command line say of echoes, motion and odometry, and the profiles."""

import re

import numpy as np
import pytest
import yaml
from document import profile_yaml

from dead_reckoning.parameters import DeadReckoningParameters
from mlsm_manager.localisation.odometry_profiles import PROFILES, OdometryKind, profile_values
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.localisation.updates import report_turn
from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.replay_parameters import ReplayParameters, replay_values
from mlsm_manager.offline.suited_parameters import (
    EchoShape,
    echo_shape_of,
    echo_sigma,
    odometry_of,
    suited,
    with_odometry,
)
from mlsm_manager.scan_matching.scan import Track
from node_support.health import Health
from recordings.motion.vehicle_motion import MotionSource
from sonar_processing.beams.beam import Beam
from sonar_processing.filters.echo_extractor import ExtractionMode


def beams(strengths):
    return [Beam(10**9, "sonar", 0.0, np.array(strengths, dtype=np.uint8), 0.1)]


@pytest.mark.parametrize(
    ("strengths", "shape"),
    [
        *(([0, 0, strongest, strongest, strongest, 0], EchoShape.PLATEAU) for strongest in (1, 127, 255)),
        ([0, 3, 60, 127, 127, 80, 5, 0], EchoShape.PEAK),
        ([0, 0, 0], EchoShape.PEAK),
    ],
)
def test_strengths_that_say_something_or_nothing_are_plateaus_and_those_that_differ_are_peaks(strengths, shape):
    assert echo_shape_of(beams(strengths)) is shape


def test_plateaus_are_taken_as_dense_points_with_a_less_certain_range():
    parameters = suited(ReplayParameters(), EchoShape.PLATEAU, fixed=())
    assert (parameters.mode, parameters.match_resolution, parameters.range_scale_deviation) == (
        ExtractionMode.DENSE, 1.0, 0.05,
    )  # fmt: skip


def test_what_the_user_set_is_held():
    parameters = suited(ReplayParameters(match_resolution=0.7), EchoShape.PLATEAU, fixed=("match_resolution",))
    assert (parameters.mode, parameters.match_resolution) == (ExtractionMode.DENSE, 0.7)


def echoing(sigma, resolution=0.1, noise=0.0, seed=0):
    rng, bins = np.random.RandomState(seed), np.arange(400)
    rows = [
        90.0 * np.exp(-0.5 * ((bins - place) * resolution / sigma) ** 2) + np.abs(rng.normal(0.0, noise, 400))
        for place in rng.uniform(60.0, 340.0, 120)
    ]
    return [Beam(10**9, "sonar", 0.0, row.astype(np.uint8), resolution) for row in rows]


@pytest.mark.parametrize("sigma", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_the_length_of_echoes_is_found(sigma, noise):
    assert echo_sigma(echoing(sigma, noise=noise)) == pytest.approx(sigma, rel=0.15)


@pytest.mark.parametrize("strengths", [[0, 0, 0, 0, 0], [7], [9, 9, 9, 9, 9, 9]])
def test_without_echoes_the_shortest_pulse_is_taken(strengths):
    assert echo_sigma(beams(strengths)) == 0.15


def test_beams_of_another_range_do_not_matter():
    other = [Beam(10**9, "sonar", 0.0, np.zeros(50, dtype=np.uint8), 0.5)] * 3
    assert echo_sigma(other + echoing(0.5)) == echo_sigma(echoing(0.5))


def test_peaks_are_filtered_by_their_own_length_unless_it_was_set():
    assert suited(ReplayParameters(), EchoShape.PEAK, (), 0.7).pulse_sigma == 0.7
    assert suited(ReplayParameters(), EchoShape.PEAK, ("pulse_sigma",), 0.7).pulse_sigma == 0.15
    assert suited(ReplayParameters(), EchoShape.PLATEAU, (), 0.7).pulse_sigma == 0.15


TIMES = np.linspace(0.0, 100.0, 50)


def track(x=0.0, y=0.0, yaw=0.0):
    return Track(TIMES, np.column_stack([np.full(50, x), np.full(50, y), np.full(50, yaw)]))


@pytest.mark.parametrize(
    ("reported", "kind"),
    [
        (track(x=TIMES), OdometryKind.DVL),
        (track(x=TIMES, yaw=TIMES / 50.0), OdometryKind.DVL),
        (track(x=3.0, yaw=np.sin(TIMES)), OdometryKind.HEADING),
        (track(x=1e-3 * np.sin(TIMES), yaw=np.sin(TIMES)), OdometryKind.HEADING),
        (track(x=3.0, y=1.0, yaw=0.4), OdometryKind.DVL),
    ],
)
def test_what_changes_tells_the_odometry(reported, kind):
    assert odometry_of(reported).kind is kind


@pytest.mark.parametrize("kind", list(OdometryKind))
def test_every_profile_is_allowed_live_and_on_recordings(kind):
    live = yaml.safe_load(profile_yaml(kind))
    assert MlsmCoreParameters.from_mapping(live["mlsm_core"]).odometry is kind
    assert with_odometry(ReplayParameters(), kind, ()) == ReplayParameters.from_mapping(replay_values(live)[0])


@pytest.mark.parametrize("kind", list(OdometryKind))
def test_every_value_of_a_profile_has_a_reason(kind):
    assert all(setting.reason for setting in PROFILES[kind])


def test_the_defaults_on_recordings_are_the_profile_of_a_dvl():
    assert with_odometry(ReplayParameters(), OdometryKind.DVL, ()) == ReplayParameters()


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
    live = yaml.safe_load(profile_yaml(kind))
    assert (
        DeadReckoningParameters(**live["dead_reckoning"]).velocity_fading
        == profile_values(kind)["rate_correlation_time"]
    )


def command_line(*words):
    return map_bag_arguments(["a.bag", "--out", "out", *words])


def refusal(capsys, *words):
    with pytest.raises(SystemExit) as ended:
        command_line(*words)
    assert ended.value.code == 2
    return capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("odometry", [(), ("--odometry", "none")])
def test_an_unknown_motion_means_no_odometry(odometry):
    options = command_line("--unknown-motion", *odometry)
    assert options.odometry is OdometryKind.NONE
    assert options.request.motion.declared is MotionSource.UNKNOWN


def test_standing_leaves_the_odometry_to_the_recording():
    options = command_line("--standing")
    assert options.odometry is None
    assert options.request.motion.declared is MotionSource.STANDING


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("--standing --odometry none", "did not move.* give --unknown-motion instead$"),
        ("--unknown-motion --odometry heading", "--odometry heading: must be none, or left out, with --unknown-motion"),
        ("--standing --unknown-motion", "not allowed with argument --standing"),
    ],
)
def test_motions_that_contradict_each_other_are_refused(capsys, words, reason):
    assert re.search(reason, refusal(capsys, *words.split()))
