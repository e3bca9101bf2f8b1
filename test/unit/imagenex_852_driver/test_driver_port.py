import errno
import socket
import threading

import pytest
import serial
from driver_line import served

from imagenex_852_driver.emulated_852 import Emulated852
from imagenex_852_driver.line.device import SonarDevice
from imagenex_852_driver.line.parameters import ConnectionParameters
from imagenex_852_driver.protocol.command import SwitchCommand
from node_support.parameters import ParameterError
from sonar_driver.line.port import (
    PortBusyError,
    PortNameError,
    PortPermissionError,
    PortUnavailableError,
    open_port,
)


def test_a_second_driver_on_a_port_is_told_so(tmp_path):
    with served(tmp_path) as (_, connection):
        first = open_port(connection.port, 115200)
        with pytest.raises(PortBusyError, match="second driver"):
            open_port(connection.port, 115200)
        first.close()


def test_a_port_is_free_again_after_the_first_driver_ended(tmp_path):
    with served(tmp_path) as (_, connection):
        open_port(connection.port, 115200).close()
        open_port(connection.port, 115200).close()


def test_a_port_without_permission_names_the_group_to_join(tmp_path, monkeypatch):
    def refuse(*arguments, **options):
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortPermissionError, match="join the group dialout") as caught:
        open_port(str(tmp_path / "none"), 115200)
    assert "\n" not in str(caught.value)


def test_a_port_that_is_not_there_may_come_back(tmp_path):
    with pytest.raises(PortUnavailableError, match="none"):
        open_port(str(tmp_path / "none"), 115200)


def test_a_kind_of_url_that_does_not_exist_is_refused():
    with pytest.raises(PortNameError, match="nonsense"):
        open_port("nonsense://port", 115200)


def test_a_head_behind_a_socket_answers():
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=_serve_one, args=(server,), daemon=True).start()
        device = SonarDevice(
            ConnectionParameters(port=f"socket://127.0.0.1:{server.getsockname()[1]}", reply_margin=1.0)
        )
        device.open()
        assert device.ping(SwitchCommand(max_range=5)).reply.max_range == 5
        device.close()


def _serve_one(server):
    client, _ = server.accept()
    head = Emulated852()
    with client:
        pieces = []
        while not pieces:
            pieces = head.receive(client.recv(100), 0.0)
        threading.Event().wait(pieces[0].time)
        client.sendall(b"".join(piece.data for piece in pieces))
        client.recv(1)


def test_waits_that_would_shrink_are_refused():
    with pytest.raises(ParameterError, match="back_off_first"):
        ConnectionParameters(back_off_first=0.9, back_off_longest=0.5)
