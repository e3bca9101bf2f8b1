"""A node whose master was restarted says so and ends, so that respawn helps; one whose master is away runs on."""

import os
import signal
import subprocess
import sys
import time

import pytest
from stopwatch import ROOT, START_TIMEOUT, STOP_TIMEOUT, free_port, state_of_master, wait_until

from imagenex_852_driver.log_file import LoggedPing, LogWriter
from imagenex_852_driver.reply import Reply, ReplyKind
from node_support.ros.node import MASTER_PERIOD

NODES = ("thresholder", "mapping", "imagenex_852_driver", "gazebo_sonar", "play_852")
# Long enough for a node to ask the absent master more often than a new master has to be asked.
AWAY = 4.0 * MASTER_PERIOD
TALKATIVE = """
import rospy
from node_support.ros.node import MasterWatch
rospy.init_node("talkative", disable_signals=True)
watch = MasterWatch()
print("watched", flush=True)
while not watch.is_lost:
    rospy.logwarn("nothing comes")
    rospy.rostime.wallsleep(0.1)
"""


class Master:
    """A master that can be stopped and started again at its address."""

    def __init__(self, logs):
        self._port = free_port()
        uri = f"http://localhost:{self._port}"
        self.environment = {**os.environ, "ROS_MASTER_URI": uri, "ROS_LOG_DIR": str(logs)}
        # Whoever is told to abort then says what each thread does.
        self.environment["PYTHONFAULTHANDLER"] = "1"
        self.start()

    def start(self):
        command, silent = ["rosmaster", "--core", "-p", str(self._port)], subprocess.DEVNULL
        self.process = subprocess.Popen(command, env=self.environment, stdout=silent, stderr=silent)
        wait_until(lambda: self.state() is not None, told="an answer of the master")

    def stop(self):
        self.process.kill()
        self.process.wait()

    def state(self):
        return state_of_master(self.environment["ROS_MASTER_URI"])


@pytest.fixture
def master(tmp_path):
    running = Master(tmp_path)
    yield running
    running.stop()


@pytest.fixture
def nodes(master, tmp_path):
    """Return the processes of nodes that have begun to publish diagnostics, by name."""
    with LogWriter(tmp_path / "short.852") as log:
        for stamp in (1e9, 1e9 + 0.2):
            log.write(LoggedPing(Reply(ReplyKind.IMX, 20, bytes(252)), stamp))
    arguments = {"play_852": [str(tmp_path / "short.852"), "--loop", "__name:=play_852"]}
    told = {"env": master.environment, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    started = {
        node: subprocess.Popen([sys.executable, str(ROOT / "nodes" / node), *arguments.get(node, [])], **told)
        for node in NODES
    }
    try:
        names = {f"/{node}" for node in NODES}
        wait_until(
            lambda: names <= set(dict(master.state()[0]).get("/diagnostics", [])), told=f"diagnostics of {names}"
        )
        yield started
    finally:
        for process in started.values():
            process.kill()
            process.communicate()


def _ends(nodes):
    """Return the exit status of each node, None of those that run."""
    return {node: process.poll() for node, process in nodes.items()}


def test_nodes_outlive_a_master_that_is_away_and_end_when_a_new_one_does_not_know_them(master, nodes):
    master.process.send_signal(signal.SIGSTOP)
    time.sleep(AWAY)
    master.process.send_signal(signal.SIGCONT)
    time.sleep(AWAY)
    master.stop()
    time.sleep(AWAY)
    assert _ends(nodes) == dict.fromkeys(NODES)

    master.start()
    outputs = {node: _last_words(process) for node, process in nodes.items()}
    told = {node: text.count("the ROS master was restarted") for node, text in outputs.items()}
    assert told == dict.fromkeys(NODES, 1), outputs
    assert _ends(nodes) == dict.fromkeys(NODES, 1), outputs


def _last_words(process):
    """Return what a process printed until it ended; one that does not end is aborted."""
    try:
        return process.communicate(timeout=STOP_TIMEOUT)[0]
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGABRT)
        return process.communicate()[0]


def test_a_node_that_logs_while_a_new_master_comes_ends_too(master):
    """Each log line makes rospy ask the master for a parameter, which makes the node known to it."""
    command = [sys.executable, "-c", TALKATIVE]
    talkative = subprocess.Popen(command, env=master.environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        # rospy tells on the same stream that it tries again, where the master is not there yet.
        assert b"watched\n" in talkative.stdout
        master.stop()
        master.start()
        assert talkative.wait(START_TIMEOUT) == 0
    finally:
        talkative.kill()
        talkative.communicate()
