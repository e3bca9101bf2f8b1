"""A virtual cable of few bits a second, with a computer at its far end, and how long what changes takes through it.

Needs root, ip and tc (package iproute2).
"""

import json
import os
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Iterator, List, Sequence, Tuple

import numpy as np

from benchmarks.programs import Programs, running, wait_until

VEHICLE, TOPSIDE, _MASK = "10.213.77.1", "10.213.77.2", 30
_NOBODY = "02:00:00:00:00:01"  # what is sent to this address is lost, and no sender learns of it
_EARLY = 1.0  # s
Version = Tuple[float, str, int]
"""When something came, which one it is, and the checksum of what it shows."""


class Cable:
    """Carries `kilobits` a second in each direction between this network and one with a computer of its own."""

    def __init__(self, kilobits: int) -> None:
        self._space, self._near, self._far = (f"umc{os.getpid()}{end}" for end in ("n", "a", "b"))
        self._shaped = ["root", "tbf", "rate", f"{kilobits}kbit", "burst", "4kb", "latency", "2s"]
        self.far_end = ["ip", "netns", "exec", self._space]
        """What a command begins with that runs on the far computer."""

    def lay(self) -> None:
        """Make the network."""
        for command in (
            ["ip", "netns", "add", self._space],
            ["ip", "link", "add", self._near, "type", "veth", "peer", "name", self._far, "netns", self._space],
            ["ip", "address", "add", f"{VEHICLE}/{_MASK}", "dev", self._near],
            ["ip", "link", "set", self._near, "up"],
            [*self.far_end, "ip", "address", "add", f"{TOPSIDE}/{_MASK}", "dev", self._far],
            [*self.far_end, "ip", "link", "set", self._far, "up"],
            [*self.far_end, "ip", "link", "set", "lo", "up"],
            ["tc", "qdisc", "add", "dev", self._near, *self._shaped],
            [*self.far_end, "tc", "qdisc", "add", "dev", self._far, *self._shaped],
        ):
            _run(command)

    def remove(self) -> None:
        """Remove the network, also from under programs that still run in it."""
        for command in (["ip", "link", "delete", self._near], ["ip", "netns", "delete", self._space]):
            subprocess.run(command, check=False, stderr=subprocess.DEVNULL)

    def cut(self, seconds: float, unplugged: bool) -> Tuple[float, float]:
        """Carry nothing for so long; return when it began and ended. unplugged: both ends see it, else all is lost."""
        began = time.time()
        if unplugged:
            _run(["ip", "link", "set", self._near, "down"])
        else:
            self._neighbours("replace", "lladdr", _NOBODY, "nud", "permanent")
        time.sleep(seconds)
        if unplugged:
            _run(["ip", "link", "set", self._near, "up"])
        else:
            self._neighbours("delete")
        return began, time.time()

    def _neighbours(self, verb: str, *how: str) -> None:
        _run(["ip", "neighbour", verb, TOPSIDE, "dev", self._near, *how])
        _run([*self.far_end, "ip", "neighbour", verb, VEHICLE, "dev", self._far, *how])

    @property
    def sent_bytes(self) -> int:
        """From here to the far computer."""
        return int(Path(f"/sys/class/net/{self._near}/statistics/tx_bytes").read_text())


def _run(command: Sequence[str]) -> None:
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)


def cannot_be_laid(study: str) -> bool:
    """Return, and say, whether this machine lacks what a cable needs. Also: ended by a signal, it is removed."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    lacks = os.geteuid() or not shutil.which("tc") or not shutil.which("ip")
    if lacks:
        print(f"{study}: skipped: it makes a network of its own, which needs root, ip and tc (package iproute2)")
    return bool(lacks)


@contextmanager
def demo_behind(kilobits: int, folder: str) -> Iterator[Tuple[Cable, Programs]]:
    """Lay a cable, and run demo.launch in real time at its near end. Both end with the block."""
    cable = Cable(kilobits)
    try:
        cable.lay()
        os.environ["ROS_IP"] = VEHICLE
        with running(VEHICLE) as programs:
            programs.demo("odometry:=dvl", f"map_directory:={folder}")
            yield cable, programs
    finally:
        cable.remove()


def versions(path: Path) -> List[Version]:
    """Return what a listener wrote, one line for each version."""
    return [tuple(json.loads(line)) for line in path.read_text().splitlines() if line.endswith("]")]


def wait_for(path: Path) -> None:
    """Wait until a listener has written something."""
    wait_until(lambda: path.exists() and path.read_text(), path.name)


def arrivals(made: List[Version], came: List[Version], numbers: Sequence[int]) -> np.ndarray:
    """Return when (k,) the versions `numbers` of those made, or newer ones, were there; infinity where never.

    Where nothing holds the cable up, they may be there before the listener at the near end has noted them.
    """
    return np.array([max(_arrival(made, came, number), made[number][0]) for number in numbers])


def _arrival(made: List[Version], came: List[Version], number: int) -> float:
    at, key, _ = made[number]
    good = {shown for _, other, shown in made[number:] if other == key}
    return next((then for then, other, shown in came if then >= at - _EARLY and other == key and shown in good), np.inf)


def told(seconds: np.ndarray) -> str:
    """Return median, 95 % and most (n,) [s] in words."""
    return f"{np.median(seconds):.1f} s, {np.percentile(seconds, 95):.1f} s, {seconds.max():.1f} s"
