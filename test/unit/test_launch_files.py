"""What `roslaunch --ros-args` tells of every launch file."""

from pathlib import Path

import pytest
from roslaunch.arg_dump import get_args

LAUNCH_FILES = sorted((Path(__file__).resolve().parents[2] / "launch").glob("*.launch"))
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
