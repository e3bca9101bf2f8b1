"""How a node's process ends, gives memory back, and asks its master whether that still knows it."""

import os
import socket
import subprocess
import sys
import threading
from contextlib import suppress

import pytest
from programs import ROOT

from node_support.ros.node import MasterWatch

END = """
import tempfile
from node_support.ros import node
folder = tempfile.TemporaryDirectory(prefix="of_a_node_")
print(folder.name, flush=True)
node._end(3)
"""
# Many arrays of all sizes, of which every tenth stays: its neighbours leave holes.
HOLES = """
import resource, sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from node_support.ros.node import give_back, hold_little
def held():
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize() / 1e6
hold_little()
before = held()
kept = [np.ones(1000 + 37 * number % 9000) for number in range(4000)]
kept = kept[::10]
give_back()
print(held() - before, sum(array.nbytes for array in kept) / 1e6)
"""
HEAD = b"HTTP/1.0 200 OK\r\nContent-type: text/xml\r\nContent-length: 100\r\n\r\n"


def test_a_node_leaves_no_temporary_folder_of_its_libraries(tmp_path):
    command, environment = [sys.executable, "-c", END], {**os.environ, "TMPDIR": str(tmp_path)}
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=environment)
    assert (done.returncode, done.stdout.startswith(str(tmp_path)), list(tmp_path.iterdir())) == (3, True, [])


def test_holes_between_arrays_that_stay_are_given_back():
    told = subprocess.run([sys.executable, "-c", HOLES, str(ROOT / "src")], capture_output=True, text=True, check=True)
    held, used = map(float, told.stdout.split())
    assert held < 2.0 * used


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.0", HEAD, HEAD + b"<?xml version='1.0'?><methodResponse>"])
def test_a_master_that_is_killed_while_it_answers_counts_as_away(monkeypatch, answer):
    with socket.create_server(("localhost", 0)) as server:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://localhost:{server.getsockname()[1]}")
        threading.Thread(target=_answer_all, args=(server, answer), daemon=True).start()
        assert not MasterWatch()._does_not_know_us()


def _answer_all(server, answer):
    with suppress(OSError):
        while True:
            with server.accept()[0] as connection:
                connection.recv(4096)
                connection.sendall(answer)


def test_a_master_that_never_answers_counts_as_away(monkeypatch):
    monkeypatch.setattr("node_support.ros.node._PATIENCE", 0.2)
    with socket.create_server(("localhost", 0)) as server:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://localhost:{server.getsockname()[1]}")
        assert not MasterWatch()._does_not_know_us()
