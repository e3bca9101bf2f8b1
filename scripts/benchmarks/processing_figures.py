"""The processing chain as users run it: beams into real nodes, clean clouds out, in one process and in many."""

import os
import signal
import socket
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np
import rosbag
import rosgraph
import rospy
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from benchmarks.harness import ROOT, Row
from sonar_processing.ros.conversions import StampedIntensityCloudArrays, header
from underwater_map_construction.msg import SonarScanLine

BEAMS, BINS = 120, 500
SCANS = 12
RATES = {"fastest rate of the 852, 19 beams/s": 19.0, "a Micron's, 23 beams/s": 23.0}
ODOMETRY_RATE = 20.0
CPU_SECONDS = 12.0
FAST = 150.0  # beams per second while scans are timed
_START_SECONDS, _END_SECONDS = 30.0, 15.0


class Load(NamedTuple):
    """What the stages are set to while scans are timed, the weakest strength sent and the time wanted, ms."""

    name: str
    thresholder: Dict[str, object]
    outlier_remover: Dict[str, object]
    weakest: int
    wanted: float


LOADS = [
    Load("no outlier removal", {"mode": "OTSU+PROPORTIONAL"}, {"mode": "NONE"}, 0, 30.0),
    Load("k = 20", {"mode": "OTSU+PROPORTIONAL"}, {"mode": "STATISTICAL", "mean_k": 20}, 0, 150.0),
    Load("k = 20, every point above the threshold", {"mode": "FIXED", "fixed_threshold": 0.0},
         {"mode": "STATISTICAL", "mean_k": 20}, 1, 150.0),
]  # fmt: skip


@contextmanager
def roscore() -> Iterator[None]:
    """Run a master of one's own and make this process a node of it; all cores may be used meanwhile."""
    cores = os.sched_getaffinity(0)
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port = probe.getsockname()[1]
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
    with tempfile.TemporaryDirectory() as log_folder:
        os.environ["ROS_LOG_DIR"] = log_folder
        os.sched_setaffinity(0, range(os.cpu_count()))
        with _running(["roscore", "-p", str(port)]):
            wait_until(rosgraph.is_master_online, "roscore")
            rospy.init_node("bench", disable_signals=True)
            yield
            rospy.signal_shutdown("measured")
        os.sched_setaffinity(0, cores)


@contextmanager
def _running(command: List[str]) -> Iterator[int]:
    """Run a command, yield its process id, and end it with Ctrl-C."""
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, start_new_session=True, **quiet)
    try:
        yield process.pid
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _cpu_seconds(roslaunch: int) -> float:
    """Return the CPU time that all nodes of a roslaunch together have used."""
    stats = [_stat(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    ticks = [int(field) for stat in stats if stat[1:2] == [str(roslaunch)] for field in stat[11:13]]
    return sum(ticks) / os.sysconf("SC_CLK_TCK")


def _stat(pid: str) -> List[str]:
    """Return the fields of /proc/PID/stat behind the name, state first; empty when the process has ended."""
    try:
        return (Path("/proc") / pid / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def wait_until(holds: Callable[[], bool], what: str) -> None:
    """Wait until `holds()`; raises RuntimeError naming `what` when it takes too long."""
    end = time.monotonic() + _START_SECONDS
    while not holds():
        if time.monotonic() > end:
            raise RuntimeError(f"no {what} after {_START_SECONDS:.0f} s")
        time.sleep(0.02)


class Sonar:
    """Sends one turn of the recorded tour of the basin again and again, with transforms, and times cleaned clouds."""

    def __init__(self) -> None:
        with rosbag.Bag(str(ROOT / "test/data/basin.bag")) as bag:
            self._beams = [message for _, message, _ in bag.read_messages(["/sonar/raw"])][BEAMS : 2 * BEAMS]
        self._strengths = [np.frombuffer(beam.intensities, np.uint8) for beam in self._beams]
        self.weakest = 0
        self._count = 0
        self._sent: Dict[int, Tuple[int, float]] = {}
        self._scan_end = 0
        self.scan_sent = 0.0
        """When the last beam of the newest cleaned scan was sent, by time.perf_counter."""
        self._latencies: List[float] = []
        self.points = 0
        self._publisher = rospy.Publisher("/sonar/raw", SonarScanLine, queue_size=100, tcp_nodelay=True)
        self._transforms = rospy.Publisher("/tf", TFMessage, queue_size=100, tcp_nodelay=True)
        rospy.Subscriber(
            "/sonar/scan/cleaned", StampedIntensityCloudArrays, self._take, buff_size=2**24, tcp_nodelay=True
        )

    def _take(self, message: StampedIntensityCloudArrays) -> None:
        """Match the cloud with its last beam, whose stamp it bears."""
        now = time.perf_counter()
        self._scan_end, self.scan_sent = self._sent[message.header.stamp.to_nsec()]
        self.points = message.cloud.width
        self._latencies.append(now - self.scan_sent)

    def wait_for_nodes(self, reader: Optional[rospy.Subscriber] = None) -> None:
        """Wait until somebody takes the beams and the transforms, and somebody publishes what `reader` reads."""
        topics = [self._publisher, self._transforms, *([reader] if reader else [])]
        wait_until(lambda: all(topic.get_num_connections() for topic in topics), "node that takes the beams")

    def send_transform(self) -> rospy.Time:
        """Publish where the sonar is now; return the stamp."""
        transform = TransformStamped(header=header(time.time_ns(), "odom"), child_frame_id="sonar")
        transform.transform.rotation.w = 1.0
        self._transforms.publish(TFMessage([transform]))
        return transform.header.stamp

    def send_beam(self) -> None:
        """Publish the next beam and its transform."""
        index = self._count % BEAMS
        beam = self._beams[index]
        beam.intensities = np.maximum(self._strengths[index], self.weakest).tobytes()
        self._count += 1
        beam.header.stamp = self.send_transform()
        self._sent[beam.header.stamp.to_nsec()] = self._count, time.perf_counter()
        self._publisher.publish(beam)

    def scan_latencies(self, scans: int) -> List[float]:
        """Send turns at `FAST` beams per second; return the time from the last beam of each scan to its cleaned cloud.

        The next scan waits for the cloud, so that its beams are not worked on meanwhile. The first scan is left out: it
        may have begun under another load.
        """
        self._latencies.clear()
        while len(self._latencies) <= scans:
            seen = len(self._latencies)
            self.send_beam()
            time.sleep(1.0 / FAST)
            if self._scan_end and (self._count - self._scan_end) % BEAMS == 0:
                wait_until(lambda seen=seen: len(self._latencies) > seen, "cleaned cloud")
        return self._latencies[1:]


def rows() -> List[Row]:
    """Return the figures of both layouts."""
    with roscore():
        sonar = Sonar()
        return [*(row for layout in ("one", "many") for row in layout_rows(layout, sonar)), map_row(sonar)]


def layout_rows(layout: str, sonar: Sonar) -> List[Row]:
    """Measure one layout."""
    rows = []
    with _running(
        ["roslaunch", "underwater_map_construction", "sonar_processing.launch", f"processes:={layout}"]
    ) as pid:
        sonar.wait_for_nodes()
        thresholder, remover = Client("/thresholder", timeout=20), Client("/outlier_remover", timeout=20)
        for name, rate in RATES.items():
            share = cpu_share(sonar, pid, rate)
            rows.append((f"{layout}: share of a core at {name}", f"{100.0 * share:.1f} %", "<= 10 %"))
        for load in LOADS:
            thresholder.update_configuration(load.thresholder)
            remover.update_configuration(load.outlier_remover)
            sonar.weakest = load.weakest
            latencies = sonar.scan_latencies(SCANS)
            name = f"{layout}: last beam of {BEAMS * BINS} points to {sonar.points} cleaned, {load.name}"
            rows.append((name, _latency_text(latencies), f"<= {load.wanted:g} ms"))
        thresholder.close()
        remover.close()
    return rows


def map_row(sonar: Sonar) -> Row:
    """Measure the time from the last beam of a scan to the map that holds it, everything in one process."""
    arrivals: List[float] = []
    reader = rospy.Subscriber("/MLSM/Markers", MarkerArray, lambda _: arrivals.append(time.perf_counter()))
    latencies = []
    with _running(["roslaunch", "underwater_map_construction", "mapping.launch"]):
        sonar.wait_for_nodes(reader)
        for _ in range(SCANS):
            sonar.scan_latencies(1)
            sent = sonar.scan_sent
            wait_until(lambda sent=sent: arrivals and arrivals[-1] > sent, "map")
            latencies.append(next(arrival for arrival in arrivals if arrival > sent) - sent)
    reader.unregister()
    return f"one: last beam of {BEAMS * BINS} points to the published map", _latency_text(latencies), "<= 100 ms"


def _latency_text(seconds: List[float]) -> str:
    return f"{1e3 * float(np.median(seconds)):.1f} ms at the median, {1e3 * max(seconds):.1f} at most"


def cpu_share(sonar: Sonar, roslaunch: int, beam_rate: float) -> float:
    """Return the nodes' share of a core while beams come live, with odometry between them."""
    start, used = time.monotonic(), _cpu_seconds(roslaunch)
    beams, transforms = 0, 0
    while time.monotonic() - start < CPU_SECONDS:
        elapsed = time.monotonic() - start
        if elapsed >= beams / beam_rate:
            sonar.send_beam()
            beams += 1
        if elapsed >= transforms / ODOMETRY_RATE:
            sonar.send_transform()
            transforms += 1
        time.sleep(0.002)
    return (_cpu_seconds(roslaunch) - used) / (time.monotonic() - start)
