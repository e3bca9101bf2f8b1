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

from benchmarks.harness import Row, SkippedError
from benchmarks.programs import Programs, running, wait_until

KILOBITS = 256
WANTED = 10.0  # s, until a change is at the far end
VEHICLE, TOPSIDE, _MASK = "10.213.77.1", "10.213.77.2", 30
_NOBODY = "02:00:00:00:00:01"  # what is sent to this address is lost, and no sender learns of it
_EARLY = 1.0  # s
Version = Tuple[float, str, int]
"""When something came, which one it is, and the checksum of what it shows."""


class Cable:
    """Carries KILOBITS a second in each direction between this network and one with a computer of its own."""

    def __init__(self) -> None:
        self._space, self._near, self._far = (f"umc{os.getpid()}{end}" for end in ("n", "a", "b"))
        self.far_end = ["ip", "netns", "exec", self._space]
        """What a command begins with that runs on the far computer."""

    def lay(self) -> None:
        """Make the network."""
        shaped = ["root", "tbf", "rate", f"{KILOBITS}kbit", "burst", "4kb", "latency", "2s"]
        for command in (
            ["ip", "netns", "add", self._space],
            ["ip", "link", "add", self._near, "type", "veth", "peer", "name", self._far, "netns", self._space],
            ["ip", "address", "add", f"{VEHICLE}/{_MASK}", "dev", self._near],
            ["ip", "link", "set", self._near, "up"],
            [*self.far_end, "ip", "address", "add", f"{TOPSIDE}/{_MASK}", "dev", self._far],
            [*self.far_end, "ip", "link", "set", self._far, "up"],
            [*self.far_end, "ip", "link", "set", "lo", "up"],
            ["tc", "qdisc", "add", "dev", self._near, *shaped],
            [*self.far_end, "tc", "qdisc", "add", "dev", self._far, *shaped],
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


@contextmanager
def demo_behind(folder: str) -> Iterator[Tuple[Cable, Programs]]:
    """Lay a cable, and run demo.launch in real time at its near end; raises SkippedError where it cannot be laid.

    Both end with the block, also where a signal ends it.
    """
    if os.geteuid() or not shutil.which("tc") or not shutil.which("ip"):
        raise SkippedError("it makes a network of its own, which needs root, ip and tc (package iproute2)")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    cable = Cable()
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
    found = []
    for number in numbers:
        at, key, _ = made[number]
        good = {shown for _, other, shown in made[number:] if other == key}
        there = (then for then, other, shown in came if then >= at - _EARLY and other == key and shown in good)
        found.append(max(next(there, np.inf), at))
    return np.array(found)


def delays(made: List[Version], came: List[Version], numbers: Sequence[int]) -> Tuple[Row, np.ndarray]:
    """Return the row of how long the versions `numbers`, changed tiles, took to the far end, and these times (k,) s."""
    seconds = arrivals(made, came, numbers) - np.array([made[number][0] for number in numbers])
    told = f"{np.median(seconds):.1f} s, {np.percentile(seconds, 95):.1f} s, {seconds.max():.1f} s"
    return (f"delay of {len(seconds)} changed tiles, median, 95 %, most", told, f"<= {WANTED:g} s"), seconds
