"""What `roslaunch --ros-args` tells of every launch file."""

import pytest
from launch_files import launched
from programs import ROOT
from roslaunch.arg_dump import get_args
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


@pytest.mark.parametrize("processes", ["one", "many"])
@pytest.mark.parametrize("name", ["vehicle", "mapping", "play_bag"])
def test_every_node_that_looks_up_the_sonar_gets_its_frame(name, processes):
    bag = ["bag:=/none.bag"] if name == "play_bag" else []
    found = launched(f"{name}.launch", "sonar_frame:=ping360_link", f"processes:={processes}", *bag)
    for node in ("mlsm_core", "line_detector", "circle_detector"):
        assert found[f"/{node}/sonar_frame"] == "ping360_link"


def test_a_recording_is_played_with_the_shapes_estimator_and_odometry_that_are_asked_for():
    asked = "shapes:=false", "estimator:=THESIS", "odometry:=heading"
    found = launched("play_bag.launch", "bag:=/none.bag", *asked)
    assert found["/mapping/detectors"] == []
    assert (found["/mlsm_core/estimator"], found["/mlsm_core/odometry"]) == ("THESIS", "HEADING")


def test_a_simulated_vehicle_without_instruments_is_followed_as_one_that_tells_nothing_of_its_motion():
    found = launched("demo.launch", "odometry:=none")
    assert (found["/sonar_simulator/instruments"], found["/mlsm_core/odometry"]) == ("NONE", "NONE")
    assert not any(name.startswith("/dead_reckoning/") for name in found)


def test_a_simulated_vehicle_with_thrusters_goes_as_it_is_commanded():
    found = launched("demo.launch", "odometry:=thrusters")
    assert (found["/sonar_simulator/instruments"], found["/mlsm_core/odometry"]) == ("COMPASS", "THRUSTERS")
    assert found["/dead_reckoning/velocity_source"] == "COMMANDS"


def test_a_sonar_that_stood_is_mounted_in_the_vehicle_and_turns_in_as_many_beams_as_are_told():
    found = launched(
        "play_bag.launch", "bag:=/none.bag", "beams:=/micron/scan_line", "standing:=true", "scan_size:=200"
    )
    assert (found["/sonar_to_cloud/mounted_in"], found["/sonar_to_cloud/scan_size"]) == ("base_link", 200)


def test_a_topside_behind_a_thin_link_sends_who_wants_the_page_to_the_vehicle():
    assert "/web_page/map_frame" in launched("topside.launch", "web:=true")
    assert "/web_page/map_frame" not in launched("topside.launch", "link:=thin")
    with pytest.raises(RLException, match="link:=thin carries no page"):
        launched("topside.launch", "web:=true", "link:=thin")
