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
from typing import List, Set

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
    """Return the seconds from SIGINT until a command that starts a master and nodes has ended."""
    port = free_port()
    environment = {**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}", "ROS_LOG_DIR": str(log.parent)}
    with log.open("wb") as output:
        launch = subprocess.Popen(
            [*command, "-p", str(port)], env=environment, stdout=output, stderr=output, start_new_session=True
        )
    try:
        _wait_for(nodes, port, launch, log)
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


def _wait_for(nodes: Set[str], port: int, launch: "subprocess.Popen[bytes]", log: Path) -> None:
    """Wait until every node has registered something besides its log, which is the first thing that a node does."""
    master = xmlrpc.client.ServerProxy(f"http://localhost:{port}")
    deadline = time.monotonic() + START_TIMEOUT
    registered: Set[str] = set()
    while not nodes <= registered:
        assert launch.poll() is None, log.read_text(errors="replace")
        assert time.monotonic() < deadline, f"not there: {nodes - registered}\n{log.read_text(errors='replace')}"
        time.sleep(0.1)
        with suppress(OSError):
            states = [(name, node) for kind in master.getSystemState("/")[2] for name, those in kind for node in those]
            registered = {node for name, node in states if node == "/rosout" or not name.endswith(_FIRST)}
