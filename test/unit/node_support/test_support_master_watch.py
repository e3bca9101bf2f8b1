"""A node asks its master whether it still knows it; whatever a dying master answers, it asks again."""

import socket
import threading
from contextlib import suppress

import pytest

from node_support.ros.node import MasterWatch

HEAD = b"HTTP/1.0 200 OK\r\nContent-type: text/xml\r\nContent-length: 100\r\n\r\n"


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
