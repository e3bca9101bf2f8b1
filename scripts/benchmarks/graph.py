"""A ROS graph of its own for figures that only running nodes have: a roscore on a free port, launch files, CPU time."""

import os
import signal
import socket
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Callable, Iterator, List

import rosgraph
import rospy

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "underwater_map_construction"
_START_SECONDS = 30.0
_END_SECONDS = 15.0


@contextmanager
def roscore() -> Iterator[None]:
    """Run a master of one's own and make this process a node of it; all cores may be used meanwhile."""
    cores = os.sched_getaffinity(0)
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port = probe.getsockname()[1]
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
    with tempfile.TemporaryDirectory() as log_folder:
        os.environ["ROS_LOG_DIR"] = log_folder
        os.sched_setaffinity(0, range(os.cpu_count()))
        master = _start(["roscore", "-p", str(port)])
        try:
            wait_until(rosgraph.is_master_online, "roscore")
            rospy.init_node("bench", disable_signals=True)
            yield
        finally:
            rospy.signal_shutdown("measured")
            _end(master)
            os.sched_setaffinity(0, cores)


@contextmanager
def launched(launch_file: str, *arguments: str) -> Iterator["Nodes"]:
    """Run a launch file of the package."""
    process = _start(["roslaunch", PACKAGE, launch_file, *arguments])
    try:
        yield Nodes(process.pid)
    finally:
        _end(process)


class Nodes:
    """The processes that a roslaunch started."""

    def __init__(self, roslaunch_pid: int) -> None:
        self._roslaunch_pid = roslaunch_pid

    def cpu_seconds(self) -> float:
        """Return the CPU time that all nodes together have used."""
        ticks = [int(field) for pid in self._pids() for field in _stat(pid)[11:13]]
        return sum(ticks) / os.sysconf("SC_CLK_TCK")

    def _pids(self) -> List[int]:
        pids = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
        return [pid for pid in pids if int((_stat(pid) or ["?", "0"])[1]) == self._roslaunch_pid]


def _stat(pid: int) -> List[str]:
    """Return the fields of /proc/PID/stat behind the name, state first; empty when the process has ended."""
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def wait_until(holds: Callable[[], bool], what: str) -> None:
    """Wait until `holds()`; raises RuntimeError naming `what` when it takes too long."""
    end = time.monotonic() + _START_SECONDS
    while not holds():
        if time.monotonic() > end:
            raise RuntimeError(f"no {what} after {_START_SECONDS:.0f} s")
        time.sleep(0.02)


def _start(command: List[str]) -> subprocess.Popen:
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def _end(process: subprocess.Popen) -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.wait(_END_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
