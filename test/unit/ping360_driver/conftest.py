import socket

import pytest


@pytest.fixture
def free_udp_port():
    """Name of a UDP port of this computer that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"udp://127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture(params=["serial", "udp"])
def port(request, tmp_path, free_udp_port):
    """Name of a port for an emulated head: a pseudo-terminal and a UDP port."""
    return str(tmp_path / "sonar") if request.param == "serial" else free_udp_port
