"""What mlsm_core's parameters allow together, and live.yaml, which takes what map_bag found to live nodes and back."""

import dataclasses
from enum import Enum
from functools import lru_cache

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from launch_files import launched
from programs import ROOT

from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.localisation.parameters import MapInput, MlsmCoreParameters
from mlsm_manager.offline.findings import Calibration
from mlsm_manager.offline.replay import NODES, ReplayParameters, live_text, live_values, replay_values
from node_support.parameters import ParameterError, describe

USED = ReplayParameters().changed(
    {"sonar_delay": 0.9, "range_scale": 0.97, "echo_deviation": 0.3, "estimator": "THESIS", "spacing": 0.7}
)


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "live.yaml"
    path.write_text(live_text(USED, "dead_reckoning", "hull"))
    return path


def test_every_node_takes_its_part_and_the_live_matcher_and_mapper_are_those_of_the_replay(written):
    values = yaml.safe_load(written.read_text())
    assert set(values) == set(NODES)
    cloud, echoes, core = (NODES[name].from_mapping(values[name]) for name in NODES)
    assert (cloud.sonar_delay, cloud.range_scale, echoes.spacing, core.echo_deviation) == (0.9, 0.97, 0.7, 0.3)
    assert (cloud.target_frame, core.odom_frame, core.base_frame) == ("dead_reckoning", "dead_reckoning", "hull")
    assert (core.start_matching, core.map_input) == (True, MapInput.MATCHED)
    assert vars(core.build_matcher()) == vars(USED.build_matcher())
    assert core.map_settings() == USED.map_settings()


def test_a_comment_says_what_it_is_for(written):
    told = "# Written by map_bag. mapping.launch, vehicle.launch and play_bag.launch take"
    assert written.read_text().startswith(told)


ANY_FRAME = st.sampled_from(["odom", "map", "corrected_map", "base_link", "5", "true", "\u00e9 #: x"])


def values_of(field):
    """Return a strategy of all that a parameter may be, its limits among them."""
    told = describe(field)
    if issubclass(field.type, Enum):
        return st.sampled_from(field.type)
    if field.type is bool:
        return st.booleans()
    if field.type is str:
        return ANY_FRAME
    kind = st.integers if field.type is int else st.floats
    return st.one_of(st.sampled_from([field.type(told.low), field.type(told.high)]), kind(told.low, told.high))


ANY_PARAMETERS = st.fixed_dictionaries(
    {field.name: values_of(field) for field in dataclasses.fields(ReplayParameters)}
).filter(lambda values: values["odometry"] is not OdometryKind.NONE or values["parts_per_turn"] == 1)


@lru_cache(maxsize=None)
def default_values(node):
    return yaml.safe_load((ROOT / f"yaml/{node}_default.yaml").read_text())


@given(ANY_PARAMETERS, ANY_FRAME, ANY_FRAME)
def test_the_nodes_take_whatever_a_replay_takes(values, odom_frame, base_frame):
    """Over their default files, as launch files load it."""
    parameters = ReplayParameters(**values)
    live = yaml.safe_load(live_text(parameters, odom_frame, base_frame))
    for name, own in live.items():
        both = {**default_values(name), **own}
        NODES[name].from_mapping(
            {**both, "expert": {**default_values(name).get("expert", {}), **own.get("expert", {})}}
        )
    assert ReplayParameters.from_mapping(replay_values(live)[0]) == parameters


@pytest.mark.parametrize(
    ("given", "values"),
    [
        ({"carve": False, "expert": {"free_scans": 30}}, {"carve": False, "free_scans": 30}),
        ({"sonar_to_cloud": {"scan_size": 200, "beam_width": 0.1}}, {}),
    ],
    ids=["plain keys and those for experts", "what only the live node knows"],
)
def test_a_replay_takes_what_it_knows(given, values):
    assert replay_values(given) == (values, [])


def test_a_file_of_an_older_version_is_taken_and_its_keys_are_named():
    old = {
        "mlsm_core": {
            "solver_kernel": "NUMPY", "matcher": "DISTRIBUTIONS", "rate_time": 20.0, "free_scans": 30,
            "estimator": "SCAN_BY_SCAN", "expert": {"min_agreement": 0.0},
        }
    }  # fmt: skip
    values, remarks = replay_values(old)
    assert values == {"free_scans": 30, "rate_correlation_time": 20.0, "estimator": "JOINT"}
    assert [remark.split(" (")[0] for remark in remarks] == [
        "min_agreement -> nothing",
        "solver_kernel -> nothing",
        "matcher -> nothing",
        "rate_time -> rate_correlation_time",
        "estimator = SCAN_BY_SCAN -> JOINT",
    ]


@pytest.mark.parametrize("group", [{"sonar_delay": 99.0}, {"no_such": 1}, [1]])
def test_what_a_node_would_refuse_is_refused_by_its_name(group):
    with pytest.raises(ParameterError, match="sonar_to_cloud"):
        replay_values({"sonar_to_cloud": group})


LAUNCHES = [
    ("mapping.launch", "processes:=one"),
    ("mapping.launch", "processes:=many"),
    ("vehicle.launch", "odom_frame:=dead_reckoning", "base_frame:=hull"),
    ("play_bag.launch", "bag:=/no.bag", "processes:=many"),
]


@pytest.mark.parametrize("launch", LAUNCHES, ids=" ".join)
def test_launch_files_load_it_over_the_nodes_own(launch, written):
    found = launched(*launch, f"parameters:={written}")
    for node, values in live_values(USED, "dead_reckoning", "hull").items():
        plain = {key: value for key, value in values.items() if key != "expert"}
        given = {**plain, **{f"expert/{key}": value for key, value in values.get("expert", {}).items()}}
        assert {key: found[f"/{node}/{key}"] for key in given} == given
    assert found["/sonar_to_cloud/scan_size"] == 120


def test_without_it_the_nodes_own_hold_and_an_argument_goes_before_it(written):
    assert launched("mapping.launch")["/mlsm_core/sonar_delay_deviation"] == 1.0
    found = launched("mapping.launch", f"parameters:={written}", "estimator:=JOINT")
    assert found["/mlsm_core/estimator"] == "JOINT"


NAMES = ("range_scale_error", "sonar_delay", "odometry_scale", "odometry_direction")
FOUND = Calibration(NAMES, np.array([0.02, 0.5, 0.01, -0.07]), np.array([0.008, 0.05, 0.009, 0.03]))


def test_it_is_told_by_name_with_its_deviation():
    told = FOUND.to_mapping()
    assert tuple(told) == NAMES
    assert told["sonar_delay"] == {"value": 0.5, "deviation": 0.05}


def test_live_yaml_holds_it_on_top_of_what_was_set_before():
    before = ReplayParameters(range_scale=0.9, sonar_delay=0.25)
    text = live_text(FOUND.applied(before), "odom", "base_link")
    after = ReplayParameters.from_mapping(replay_values(yaml.safe_load(text))[0])
    assert (after.range_scale, after.sonar_delay) == (pytest.approx(0.918), pytest.approx(0.75))
    assert (after.range_scale_deviation, after.sonar_delay_deviation) == (0.008, 0.05)
    assert after.plateau_scale_deviation == 0.0
    assert (after.odometry_scale, after.odometry_direction) == (0.01, -0.07)


def test_a_run_that_went_astray_is_told_within_what_parameters_allow():
    astray = Calibration(NAMES, np.array([9.0, -99.0, 0.0, 9.0]), np.full(4, 9.0))
    after = astray.applied(ReplayParameters())
    assert (after.range_scale, after.sonar_delay, after.odometry_direction) == (2.0, -10.0, 3.2)


def test_a_user_meets_no_more_parameters_than_fit_on_a_page():
    assert len(dataclasses.fields(MlsmCoreParameters)) - len(MlsmCoreParameters.expert_names()) <= 40


@pytest.mark.parametrize(("values", "blocks"), [({}, 240 * 100), ({"size_x_meters": 0, "size_y_meters": 0}, 0)])
def test_the_default_reserves_the_thesis_basin_and_nothing_must_be(values, blocks):
    assert MlsmCoreParameters(**values).expected_blocks == blocks


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"size_x_meters": 9e4, "size_y_meters": 9e4}, r"size_x_meters = 90000\.0.*at most 16000000 cells"),
        ({"map_frame": "odom"}, "map_frame = 'odom': must differ from odom_frame"),
        ({"odometry": "NONE", "parts_per_turn": 3}, "parts_per_turn = 3: must be 1 with odometry = NONE"),
    ],
)
def test_values_that_contradict_each_other_or_that_no_memory_holds_are_refused(values, reason):
    with pytest.raises(ParameterError, match=reason):
        MlsmCoreParameters(**values)
