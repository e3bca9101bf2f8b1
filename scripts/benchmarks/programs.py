"""Programs that a study runs beside itself: demo.launch in real time and more, under a master of their own."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import Callable, Iterator, List

from benchmarks.harness import ROOT

sys.path += [str(ROOT / "test/rostest"), str(ROOT / "test/stopping")]
from stopwatch import PACKAGE, free_port

_DEMO = ("rviz:=false", "real_time_factor:=1.0")
_PATIENCE = 240.0  # s until the graph runs


class Programs:
    """What runs at one time, without its output."""

    def __init__(self, host: str = "localhost", before: str = "") -> None:
        """host: of the master. before: what launch commands begin with, in words."""
        self._port, self._before = free_port(), before.split()
        os.environ["ROS_MASTER_URI"] = f"http://{host}:{self._port}"
        self._running: List[subprocess.Popen] = []

    def demo(self, *arguments: str) -> None:
        """Start demo.launch, and the master with it."""
        self.start(*self._before, "roslaunch", "-p", self._port, PACKAGE, "demo.launch", *_DEMO, *arguments)

    def launch(self, file: str, *arguments: str) -> subprocess.Popen:
        """Start another launch file when there is a master."""
        return self.start(*self._before, "roslaunch", "--wait", PACKAGE, file, *arguments)

    def start(self, *command: object, **environment: str) -> subprocess.Popen:
        """Start a program."""
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._running.append(subprocess.Popen([*map(str, command)], env={**os.environ, **environment}, **quiet))
        return self._running[-1]

    def end(self, *these: subprocess.Popen) -> None:
        """End programs, all where none is named, the newest first."""
        for one in reversed(these or self._running):
            one.terminate()
            one.wait()


@contextmanager
def running(host: str = "localhost", before: str = "") -> Iterator[Programs]:
    """Yield programs that end with the block."""
    programs = Programs(host, before)
    try:
        yield programs
    finally:
        programs.end()


def wait_for_graph() -> None:
    """Wait until the demo's nodes begin to run."""
    import rosgraph

    wait_until(lambda: rosgraph.is_master_online() and rosgraph.Master("/bench").hasParam("/use_sim_time"), "the graph")


def wait_until(holds: Callable[[], object], what: str) -> None:
    """Wait for what comes; ends the program where it never does."""
    end = time.monotonic() + _PATIENCE
    while not holds():
        if time.monotonic() > end:
            sys.exit(f"{what}: not there after {_PATIENCE:g} s")
        time.sleep(0.1)
