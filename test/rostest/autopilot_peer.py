"""An autopilot on the other end of a UDP link."""

import socket
import threading
import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from node_support.health import Health

PATIENCE = 60.0  # s: for an event that comes; a busy machine may take seconds
AHEAD_NS = 5000 * 10**9


class Peer:
    """Sends a HEARTBEAT and answers TIMESYNC with a clock that is `ahead_ns` ahead of ours."""

    def __init__(
        self, name, system=1, firmware=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, ahead_ns=AHEAD_NS, clock=time.monotonic_ns
    ):
        self.ahead_ns, self._clock, self.received, self.arrivals = ahead_ns, clock, [], []
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self._mav.robust_parsing = True
        self._firmware, self._closing = firmware, threading.Event()
        self._address = ("127.0.0.1", int(name.rpartition(":")[2]))
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.02)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def now_ns(self):
        return self._clock() + self.ahead_ns

    def send(self, message):
        self._socket.sendto(message.pack(self._mav), self._address)

    def heartbeat(self):
        self.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_SUBMARINE, self._firmware, 0, 0, 0, 3))

    def of_type(self, kind):
        return [message for message in list(self.received) if message.get_type() == kind]

    def close(self):
        self._closing.set()
        self._thread.join()
        self._socket.close()

    def _run(self):
        beaten = 0.0
        while not self._closing.is_set():
            if time.monotonic() - beaten > 0.2:
                beaten = time.monotonic()
                self.heartbeat()
            try:
                data = self._socket.recv(65535)
            except (socket.timeout, ConnectionRefusedError):
                continue
            for message in self._mav.parse_buffer(data) or []:
                self.arrivals.append(time.monotonic())
                self.received.append(message)
                if message.get_type() == "TIMESYNC" and not message.tc1:
                    self.send(mavlink.MAVLink_timesync_message(self.now_ns(), message.ts1))


def wait_until(holds):
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.005)


def quiet_health():
    return Health("autopilot_link", lambda line: None)
