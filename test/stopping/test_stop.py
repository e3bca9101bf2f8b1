"""Ctrl-C ends every launch file within two seconds, however many nodes it has and whatever they are doing."""

import pytest
from stopwatch import ROOT, seconds_of, seconds_to_stop

BAG = f"bag:={ROOT / 'test/data/basin.bag'}"
LIMIT = 2.0
# What roslaunch takes for its master alone on a machine with nothing else to do.
QUIET = 0.7
# Another program may take the processor during one attempt.
ATTEMPTS = 8


@pytest.mark.parametrize(
    ("launch_file", "arguments"),
    [
        ("demo.launch", ["rviz:=false"]),
        ("driver_emulated.launch", ["sonar:=ping360"]),
        ("play_bag.launch", ["rviz:=false", BAG]),
        ("vehicle.launch", ["standing:=true", "servo:=true", "processes:=many"]),
    ],
)
def test_ctrl_c_ends_it_within_two_seconds(tmp_path, launch_file, arguments):
    """A machine on which the master alone takes three times as long as QUIET may take three times as long."""
    given = [f"link:={tmp_path / 'head'}"] if launch_file.startswith("driver") else []
    for _ in range(ATTEMPTS):
        seconds = seconds_to_stop(launch_file, [*arguments, *given], tmp_path / "log")
        if seconds < LIMIT or seconds < LIMIT * seconds_of(["roscore"], {"/rosout"}, tmp_path / "log") / QUIET:
            return
    pytest.fail(f"{seconds:.1f} s")
