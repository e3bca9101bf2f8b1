"""What `roslaunch --ros-args` tells of every launch file."""

import pytest
from programs import ROOT
from roslaunch.arg_dump import get_args
from roslaunch.config import load_config_default
from roslaunch.core import RLException

LAUNCH = ROOT / "launch"
LAUNCH_FILES = sorted(LAUNCH.glob("*.launch"))
REQUIRED = {"play_bag": {"bag"}}


@pytest.fixture(params=LAUNCH_FILES, ids=lambda path: path.stem)
def launch_file(request):
    """Return a launch file's name and its arguments: name to (doc, default)."""
    return request.param.stem, get_args([str(request.param)])


def test_every_argument_says_what_it_is(launch_file):
    _, arguments = launch_file
    assert [name for name, (doc, _) in arguments.items() if not doc] == []


def test_only_what_must_be_given_is_listed_as_required(launch_file):
    """roslaunch lists every argument as required whose default is empty."""
    name, arguments = launch_file
    assert {key for key, (_, default) in arguments.items() if not default} == REQUIRED.get(name, set())


def parameters(name, **arguments):
    """Return the parameters that a launch file sets, by their full names."""
    words = [f"{key}:={value}" for key, value in arguments.items()]
    config = load_config_default([(str(LAUNCH / f"{name}.launch"), words)], port=None, verbose=False)
    return {key: one.value for key, one in config.params.items()}


@pytest.mark.parametrize("processes", ["one", "many"])
@pytest.mark.parametrize("name", ["vehicle", "mapping", "play_bag"])
def test_every_node_that_looks_up_the_sonar_gets_its_frame(name, processes):
    bag = {"bag": "/none.bag"} if name == "play_bag" else {}
    found = parameters(name, sonar_frame="ping360_link", processes=processes, **bag)
    for node in ("mlsm_core", "line_detector", "circle_detector"):
        assert found[f"/{node}/sonar_frame"] == "ping360_link"


def test_a_recording_is_played_with_the_shapes_estimator_and_odometry_that_are_asked_for():
    found = parameters("play_bag", bag="/none.bag", shapes="false", estimator="THESIS", odometry="heading")
    assert found["/mapping/detectors"] == []
    assert (found["/mlsm_core/estimator"], found["/mlsm_core/odometry"]) == ("THESIS", "HEADING")


def test_a_simulated_vehicle_without_instruments_is_followed_as_one_that_tells_nothing_of_its_motion():
    found = parameters("demo", odometry="none")
    assert (found["/sonar_simulator/instruments"], found["/mlsm_core/odometry"]) == ("NONE", "NONE")
    assert not any(name.startswith("/dead_reckoning/") for name in found)


def test_a_topside_behind_a_thin_link_sends_who_wants_the_page_to_the_vehicle():
    assert "/web_page/map_frame" in parameters("topside", web="true")
    assert "/web_page/map_frame" not in parameters("topside", link="thin")
    with pytest.raises(RLException, match="link:=thin carries no page"):
        parameters("topside", web="true", link="thin")
