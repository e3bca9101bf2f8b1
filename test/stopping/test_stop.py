"""Ctrl-C ends map_bag and every launch file within two seconds, whatever they are doing."""

import os
import pty
import signal
import subprocess
import sys
import time

import pytest
from stopwatch import ROOT, seconds_of, seconds_to_stop

BAG = str(ROOT / "test/data/basin.bag")
MAP_BAG = [sys.executable, str(ROOT / "nodes/map_bag")]
LIMIT = 2.0
# What the help of map_bag, and roslaunch for its master alone, take on a machine with nothing else to do.
QUIET = 0.7
# Another program may take the processor during one attempt.
ATTEMPTS = 8


def ends_in_time(seconds_to_end, seconds_of_little):
    """Return whether something ends within LIMIT.

    A machine on which little takes three times as long as QUIET may take three times as long.
    """
    attempts = (seconds_to_end() for _ in range(ATTEMPTS))
    return any(seconds < LIMIT or seconds < LIMIT * seconds_of_little() / QUIET for seconds in attempts)


@pytest.mark.parametrize(
    ("launch_file", "arguments"),
    [
        ("demo.launch", ["rviz:=false"]),
        ("driver_emulated.launch", ["sonar:=ping360"]),
        ("play_bag.launch", ["rviz:=false", f"bag:={BAG}"]),
        ("vehicle.launch", ["standing:=true", "servo:=true", "processes:=many"]),
    ],
)
def test_ctrl_c_ends_a_launch_file_however_many_nodes_it_has(tmp_path, launch_file, arguments):
    link = [f"link:={tmp_path / 'head'}"] if launch_file.startswith("driver") else []
    log = tmp_path / "log"
    assert ends_in_time(
        lambda: seconds_to_stop(launch_file, [*arguments, *link], log),
        lambda: seconds_of(["roscore"], {"/rosout"}, log),
    )


def test_ctrl_c_ends_map_bag_and_leaves_nothing(tmp_path):
    assert ends_in_time(lambda: seconds_to_end_map_bag(tmp_path), seconds_for_help)
    assert list(tmp_path.iterdir()) == []


def seconds_for_help():
    """Return how long map_bag takes to start, to print its help and to end, s."""
    start = time.monotonic()
    subprocess.run([*MAP_BAG, "--help"], stdout=subprocess.DEVNULL, check=True)
    return time.monotonic() - start


def seconds_to_end_map_bag(out):
    """Return how long map_bag takes to end after Ctrl-C while it matches scans, s."""
    terminal, end = pty.openpty()
    # Tests that a shell runs in the background would hand on that Ctrl-C is ignored.
    process = subprocess.Popen(
        [*MAP_BAG, BAG, "--refine", "--out", str(out)],
        stderr=end, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    shown = b""
    while b"match" not in shown:
        shown += os.read(terminal, 4096)
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    assert process.wait(timeout=60) == 1
    seconds = time.monotonic() - start
    os.close(terminal)
    os.close(end)
    return seconds
