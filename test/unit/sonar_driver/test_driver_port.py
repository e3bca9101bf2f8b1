"""Opening ports, and what is said of those that cannot be opened; ports over UDP."""

import errno
import socket
import threading

import pytest
import serial
from emulated_drivers import IMAGENEX_852, free_udp_port, served, wait_until

from imagenex_852_driver.command import SwitchCommand
from imagenex_852_driver.device import SonarDevice
from imagenex_852_driver.emulated_852 import Emulated852
from imagenex_852_driver.parameters import ConnectionParameters
from sonar_driver.head_server import UdpLine
from sonar_driver.port import PortRefusedError, PortUnavailableError, datagram_address, open_port, port_losses


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


@pytest.mark.parametrize(
    ("name", "kind", "complaint"),
    [
        ("/dev/none", PortUnavailableError, "none"),
        ("nonsense://port", PortRefusedError, "nonsense"),
        *((name, PortRefusedError, "udp://HOST:PORT")
          for name in ("udp://", "udp://host", "udp://host:", "udp://host:0", "udp://host:70000", "udp://:1")),
    ],
)  # fmt: skip
def test_a_port_that_is_not_there_may_come_back_and_a_name_that_is_none_is_refused(name, kind, complaint):
    with pytest.raises(kind, match=complaint):
        open_port(name, 115200)


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


@pytest.fixture
def ends():
    """Yield a head's end of a connection, and the driver's port at the other end."""
    name = free_udp_port()
    head = UdpLine(*datagram_address(name))
    head.open()
    port = open_port(name, 115200)
    yield head, port
    port.close()
    head.close()


def test_bytes_go_there_and_back_and_the_rest_of_a_datagram_is_kept_for_the_next_read(ends):
    head, port = ends
    port.write(b"command")
    assert wait_until(lambda: head.read() == b"command")
    head.write(b"abcdef")
    assert (port.read(2), port.in_waiting, port.read(4)) == (b"ab", 4, b"cdef")


def test_a_read_ends_without_enough_bytes(ends):
    assert ends[1].read(10) == b""


def test_where_nobody_listens_the_port_is_lost(ends):
    head, port = ends
    head.close()
    port.write(b"?")
    with pytest.raises(PortUnavailableError, match="is lost"), port_losses("udp"):
        port.read(1)
