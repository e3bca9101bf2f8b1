"""Opening ports, and what is said of those that cannot be opened; ports over UDP."""

import errno
import socket
import threading
import time

import pytest
import serial
from emulated_drivers import IMAGENEX_852, free_udp_port, served

from imagenex_852_driver.command import SwitchCommand
from imagenex_852_driver.device import SonarDevice
from imagenex_852_driver.emulated_852 import Emulated852
from imagenex_852_driver.parameters import ConnectionParameters
from node_support.parameters import ParameterError
from sonar_driver.head_server import UdpLine
from sonar_driver.port import PortRefusedError, PortUnavailableError, datagram_address, open_port, port_losses

NO_SPEED = 0


def test_a_second_driver_on_a_port_is_told_so_until_the_first_one_ended(tmp_path):
    with served(IMAGENEX_852, tmp_path / "sonar") as (_, connection):
        first = open_port(connection.port, 115200)
        with pytest.raises(PortRefusedError, match="second driver"):
            open_port(connection.port, 115200)
        first.close()
        open_port(connection.port, 115200).close()


def test_a_port_without_permission_names_the_group_to_join(tmp_path, monkeypatch):
    def refuse(*arguments, **options):
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortRefusedError, match="join the group dialout") as caught:
        open_port(str(tmp_path / "none"), 115200)
    assert "\n" not in str(caught.value)


def test_a_port_that_is_not_there_may_come_back(tmp_path):
    with pytest.raises(PortUnavailableError, match="none"):
        open_port(str(tmp_path / "none"), 115200)


def test_a_kind_of_url_that_does_not_exist_is_refused():
    with pytest.raises(PortRefusedError, match="nonsense"):
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


@pytest.fixture
def line():
    """Yield a head's end of a connection, and the name under which a driver opens the other end."""
    name = free_udp_port()
    head = UdpLine(*datagram_address(name))
    head.open()
    yield head, name
    head.close()


def wait_for_bytes(head):
    end = time.monotonic() + 60.0
    data = b""
    while not data and time.monotonic() < end:
        data = head.read()
    return data


def test_bytes_go_there_and_back(line):
    head, name = line
    port = open_port(name, NO_SPEED)
    port.write(b"command")
    assert wait_for_bytes(head) == b"command"
    head.write(b"reply")
    assert port.read(5) == b"reply"
    port.close()


def test_the_rest_of_a_datagram_is_kept_for_the_next_read(line):
    head, name = line
    port = open_port(name, NO_SPEED)
    port.write(b"?")
    wait_for_bytes(head)
    head.write(b"abcdef")
    assert (port.read(2), port.in_waiting, port.read(4)) == (b"ab", 4, b"cdef")
    port.close()


def test_a_read_ends_without_enough_bytes(line):
    port = open_port(line[1], NO_SPEED)
    assert port.read(10) == b""
    port.close()


def test_where_nobody_listens_the_port_is_lost(line):
    head, name = line
    head.close()
    port = open_port(name, NO_SPEED)
    port.write(b"?")
    with pytest.raises(PortUnavailableError, match="is lost"), port_losses(name):
        port.read(1)
    port.close()


@pytest.mark.parametrize(
    "name", ["udp://", "udp://host", "udp://host:", "udp://host:0", "udp://host:70000", "udp://:1"]
)
def test_a_name_that_is_no_address_is_refused(name):
    with pytest.raises(PortRefusedError, match="udp://HOST:PORT"):
        open_port(name, NO_SPEED)


def test_an_address_has_a_host_and_a_number():
    assert datagram_address("udp://sonar.local:12345") == ("sonar.local", 12345)
