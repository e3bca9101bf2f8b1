import socket
import time

import pytest

from sonar_driver.emulator.head_server import UdpLine
from sonar_driver.line.port import PortNameError, PortUnavailableError, datagram_address, open_port, port_losses

NO_SPEED = 0


@pytest.fixture
def line():
    """Yield a head's end of a connection, and the name under which a driver opens the other end."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        number = probe.getsockname()[1]
    head = UdpLine("127.0.0.1", number)
    head.open()
    yield head, f"udp://127.0.0.1:{number}"
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
    with pytest.raises(PortNameError, match="udp://HOST:PORT"):
        open_port(name, NO_SPEED)


def test_an_address_has_a_host_and_a_number():
    assert datagram_address("udp://sonar.local:12345") == ("sonar.local", 12345)
