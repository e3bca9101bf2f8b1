"""The simulator: bags without a master, and the node's clock and load."""

import hashlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import List

import numpy as np
import rosbag
import rospy
from rosgraph_msgs.msg import Clock

from benchmarks.table import Row
from sonar_simulator.simulation.bag_tool import main as simulate_bag

ROOT = Path(__file__).resolve().parents[2]
LIVE_SECONDS = 8.0
START_TIMEOUT = 20.0
_TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")


def bag_rows() -> List[Row]:
    """Measure simulate_bag on every world's tour, rays as in the simulator's defaults; the median of three."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "survey.bag"
        for world, model in (("basin", "laser_cone"), ("tank", "laser_cone"), ("harbour", "laser_cone"),
                             ("tank", "physical"), ("harbour", "physical")):  # fmt: skip
            wall, busy = np.median([_bag_seconds(out, world, model) for _ in range(3)], axis=0)
            with rosbag.Bag(str(out)) as bag:
                simulated = bag.get_end_time() - bag.get_start_time()
            figure = f"{simulated / wall:.0f} times real time ({simulated / busy:.0f} of its own CPU time)"
            rows.append((f"simulate_bag, {world}, {model}, {simulated:.0f} s", figure, ">= 100"))
    return rows


def seed_rows() -> List[Row]:
    """Write the tank's bag with two seeds, the first one twice, and compare bytes."""
    with tempfile.TemporaryDirectory() as folder:
        hashes = [_bag_hash(Path(folder) / f"{number}.bag", seed) for number, seed in enumerate((1, 1, 2))]
    same, other = hashes[0] == hashes[1], hashes[0] == hashes[2]
    figure = f"{'equal' if same else 'different'} bytes; another seed: {'equal' if other else 'different'}"
    return [("simulate_bag, tank, physical, the same seed twice", figure, "equal; different")]


def _bag_hash(out: Path, seed: int) -> str:
    _bag_seconds(out, "tank", "physical", f"seed={seed}")
    return hashlib.sha256(out.read_bytes()).hexdigest()


def _bag_seconds(out: Path, world: str, model: str, *settings: str) -> List[float]:
    wall, busy = time.perf_counter(), time.process_time()
    arguments = ["--world", world, "--out", str(out), "--quiet"]
    for setting in (f"echo_model={model}", *settings):
        arguments += ["--set", setting]
    if simulate_bag(arguments):
        sys.exit("simulate_bag failed")
    return [time.perf_counter() - wall, time.process_time() - busy]


class _Ticks:
    """When the simulated clock ticked, in wall and simulated seconds."""

    def __init__(self) -> None:
        self.times: List[List[float]] = []
        self._subscriber = rospy.Subscriber("/clock", Clock, self._take, queue_size=1000, tcp_nodelay=True)

    def _take(self, clock: Clock) -> None:
        self.times.append([time.monotonic(), clock.clock.to_sec()])


def live_rows() -> List[Row]:
    """Measure the node alone, in the basin, on a master of its own."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port = probe.getsockname()[1]
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
    master = _started(["roscore", "-p", str(port)])
    try:
        rospy.init_node("vehicle_figures", disable_signals=True)
        rospy.set_param("/use_sim_time", False)
        rospy.set_param("robot_description", (ROOT / "urdf/charle.urdf").read_text())
        return [row for factor in (1.0, 10.0) for row in _live_rows(factor)]
    finally:
        _stopped(master)


def _live_rows(factor: float) -> List[Row]:
    ticks = _Ticks()
    arguments = [f"_real_time_factor:={factor}", "_wait_for_listener:=false", "__name:=sonar_simulator"]
    node = _started(["rosrun", "underwater_map_construction", "sonar_simulator", *arguments])
    try:
        deadline = time.monotonic() + START_TIMEOUT
        while len(ticks.times) < 20 and time.monotonic() < deadline:
            time.sleep(0.1)
        ticks.times.clear()
        before = _cpu_seconds(node.pid)
        time.sleep(LIVE_SECONDS)
        busy, seen = _cpu_seconds(node.pid) - before, np.array(ticks.times)
    finally:
        stop = time.monotonic()
        _stopped(node)
        stop = time.monotonic() - stop
    wall, simulated = seen.T
    real = np.polyfit(wall, simulated, 1)[0]
    late = (wall - wall[0]) - (simulated - simulated[0]) / factor
    late -= late.min()
    name = f"simulator at {factor:g} times real time"
    median, most = 1e3 * np.median(late), 1e3 * np.percentile(late, 95)
    return [
        (f"{name}: rate kept", f"{real:.3f}", f"{factor:g}"),
        (f"{name}: ticks later than the earliest", f"{median:.1f} ms, 95 % {most:.1f} ms", ""),
        (f"{name}: CPU", f"{100.0 * busy / LIVE_SECONDS:.0f} % of a core", ""),
        (f"{name}: Ctrl-C", f"{stop:.2f} s", "<= 2 s"),
    ]


def _started(command: List[str]) -> "subprocess.Popen[bytes]":
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    time.sleep(3.0)
    return process


def _stopped(process: "subprocess.Popen[bytes]") -> None:
    process.send_signal(signal.SIGINT)
    process.wait(10.0)


def _cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_SECOND


def rows() -> List[Row]:
    """Return the figures of the simulated vehicle."""
    return bag_rows() + seed_rows() + live_rows()
