"""Starts a launch file on a master of its own, waits until all its nodes run, and measures how long Ctrl-C takes."""

import os
import random
import signal
import socket
import subprocess
import time
import xmlrpc.client
from contextlib import suppress
from pathlib import Path
from typing import Callable, List, Optional, Set

PACKAGE = "underwater_map_construction"
START_TIMEOUT = 300.0
STOP_TIMEOUT = 120.0
ROOT = Path(__file__).resolve().parents[2]
# Every node has these before it begins to do anything.
_FIRST = ("/rosout", "/clock", "/get_loggers", "/set_logger_level")


def seconds_to_stop(launch_file: str, arguments: List[str], log: Path) -> float:
    """Return the seconds from SIGINT until a launch file and all its nodes have ended. Raises AssertionError."""
    launch = [PACKAGE, launch_file, *arguments]
    told = subprocess.run(["roslaunch", "--nodes", *launch], stdout=subprocess.PIPE, text=True, check=True).stdout
    return seconds_of(["roslaunch", *launch], set(told.split()), log)


def seconds_of(command: List[str], nodes: Set[str], log: Path) -> float:
    """Return the seconds from SIGINT until a command that starts a master and nodes has ended.

    Raises AssertionError for nodes that do not come.
    """
    port = free_port()
    uri = f"http://localhost:{port}"
    environment = {**os.environ, "ROS_MASTER_URI": uri, "ROS_LOG_DIR": str(log.parent)}
    with log.open("wb") as output:
        launch = subprocess.Popen(
            [*command, "-p", str(port)], env=environment, stdout=output, stderr=output, start_new_session=True
        )

    def is_up() -> bool:
        """Whether every node has registered something besides its log, which is the first thing that a node does."""
        assert launch.poll() is None, log.read_text(errors="replace")
        states = [(name, node) for kind in state_of_master(uri) or () for name, those in kind for node in those]
        return nodes <= {node for name, node in states if node == "/rosout" or not name.endswith(_FIRST)}

    try:
        wait_until(is_up, told=f"all of {nodes}")
        start = time.monotonic()
        launch.send_signal(signal.SIGINT)
        launch.wait(STOP_TIMEOUT)
        return time.monotonic() - start
    finally:
        if launch.poll() is None:
            launch.kill()


def free_port() -> int:
    """Return a port on which nobody listens, and which the system gives to none of the connections that begin now."""
    with open("/proc/sys/net/ipv4/ip_local_port_range") as file:
        lowest = int(file.read().split()[0])
    for port in random.sample(range(lowest // 2, lowest), 100):
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("localhost", port))
            return port
    raise AssertionError(f"no free port from {lowest // 2} to {lowest}")


def wait_until(holds: Callable[[], bool], seconds: float = START_TIMEOUT, told: str = "") -> None:
    """Wait until a state holds; raises AssertionError, which says what is `told`, after so many seconds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"not within {seconds:g} s: {told}"
        time.sleep(0.05)


def state_of_master(uri: str) -> Optional[list]:
    """Return publishers, subscribers and services, None where the master does not answer."""
    try:
        return xmlrpc.client.ServerProxy(uri).getSystemState("/")[2]
    except OSError:
        return None
