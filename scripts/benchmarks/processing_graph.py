"""The processing chain as users run it: beams into real nodes, clean clouds out, in one process and in many."""

import time
from dataclasses import dataclass
from typing import Dict, List, Tuple

import numpy as np
import rosbag
import rospy
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from benchmarks.graph import ROOT, Nodes, launched, roscore, wait_until
from benchmarks.table import Row
from sonar_processing.ros.conversions import StampedIntensityCloudArrays, header
from underwater_map_construction.msg import SonarScanLine

BEAMS, BINS = 120, 500
SCANS = 12
RATES = {"fastest rate of the 852, 19 beams/s": 19.0, "a Micron's, 23 beams/s": 23.0}
ODOMETRY_RATE = 20.0
CPU_SECONDS = 12.0
FAST = 150.0
LAYOUTS = ("one", "many")


@dataclass(frozen=True)
class Load:
    """What the stages are set to while scans are timed, the weakest strength sent and the time wanted, ms."""

    name: str
    thresholder: Dict[str, object]
    outlier_remover: Dict[str, object]
    weakest: int
    wanted: float


OTSU = {"mode": "OTSU+PROPORTIONAL"}
LOADS = [
    Load("no outlier removal", OTSU, {"mode": "NONE"}, 0, 30.0),
    Load("k = 20", OTSU, {"mode": "STATISTICAL", "mean_k": 20}, 0, 150.0),
    Load("k = 20, every point above the threshold", {"mode": "FIXED", "fixed_threshold": 0.0},
         {"mode": "STATISTICAL", "mean_k": 20}, 1, 150.0),
]  # fmt: skip


class Sonar:
    """Sends recorded beams with their transforms, and takes the time until the cleaned cloud is there."""

    def __init__(self, beams: List[SonarScanLine]) -> None:
        self._beams = beams
        self._strengths = [np.frombuffer(beam.intensities, np.uint8) for beam in beams]
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

    @property
    def is_connected(self) -> bool:
        """Whether somebody takes the beams and the transforms."""
        return self._publisher.get_num_connections() > 0 and self._transforms.get_num_connections() > 0

    def send_transform(self) -> rospy.Time:
        """Publish where the sonar is now; return the stamp."""
        transform = TransformStamped(header=header(time.time_ns(), "odom"), child_frame_id="sonar")
        transform.transform.rotation.w = 1.0
        self._transforms.publish(TFMessage([transform]))
        return transform.header.stamp

    def send_beam(self) -> None:
        """Publish the next beam and its transform."""
        index = self._count % len(self._beams)
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


def recorded_beams() -> List[SonarScanLine]:
    """Return one turn of the recorded tour of the basin."""
    with rosbag.Bag(str(ROOT / "test/data/basin.bag")) as bag:
        beams = [message for _, message, _ in bag.read_messages(["/sonar/raw"])]
    return beams[BEAMS : 2 * BEAMS]


def layout_rows(layout: str, sonar: Sonar) -> List[Row]:
    """Measure one layout."""
    rows = []
    with launched("sonar_processing.launch", f"processes:={layout}") as nodes:
        wait_until(lambda: sonar.is_connected, "node that takes the beams")
        thresholder, remover = Client("/thresholder", timeout=20), Client("/outlier_remover", timeout=20)
        rows += [cpu_row(layout, name, cpu_share(sonar, nodes, rate)) for name, rate in RATES.items()]
        for load in LOADS:
            thresholder.update_configuration(load.thresholder)
            remover.update_configuration(load.outlier_remover)
            rows.append(latency_row(layout, load, sonar))
        thresholder.close()
        remover.close()
    return rows


def cpu_row(layout: str, name: str, share: float) -> Row:
    """Return the table's row of a share of a core."""
    return f"{layout}: share of a core at {name}", f"{100.0 * share:.1f} %", "<= 10 %"


def latency_row(layout: str, load: Load, sonar: Sonar) -> Row:
    """Measure a load and return the table's row."""
    sonar.weakest = load.weakest
    latencies = sonar.scan_latencies(SCANS)
    name = f"{layout}: last beam of {BEAMS * BINS} points to {sonar.points} cleaned, {load.name}"
    return (
        name,
        f"{1e3 * float(np.median(latencies)):.1f} ms at the median, {1e3 * max(latencies):.1f} at most",
        f"<= {load.wanted:g} ms",
    )


def map_row(sonar: Sonar) -> Row:
    """Measure the time from the last beam of a scan to the map that holds it, everything in one process."""
    arrivals: List[float] = []
    reader = rospy.Subscriber("/MLSM/Markers", MarkerArray, lambda _: arrivals.append(time.perf_counter()))
    latencies = []
    with launched("mapping.launch") as _:
        wait_until(lambda: sonar.is_connected and reader.get_num_connections() > 0, "node that takes the beams")
        for _ in range(SCANS):
            sonar.scan_latencies(1)
            sent = sonar.scan_sent
            wait_until(lambda sent=sent: arrivals and arrivals[-1] > sent, "map")
            latencies.append(next(arrival for arrival in arrivals if arrival > sent) - sent)
    reader.unregister()
    figures = f"{1e3 * float(np.median(latencies)):.0f} ms at the median, {1e3 * max(latencies):.0f} at most"
    return f"one: last beam of {BEAMS * BINS} points to the published map", figures, "<= 100 ms"


def cpu_share(sonar: Sonar, nodes: Nodes, beam_rate: float) -> float:
    """Return the nodes' share of a core while beams come live, with odometry between them."""
    start, used = time.monotonic(), nodes.cpu_seconds()
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
    return (nodes.cpu_seconds() - used) / (time.monotonic() - start)


def rows() -> List[Row]:
    """Return the figures of both layouts."""
    with roscore():
        sonar = Sonar(recorded_beams())
        return [*(row for layout in LAYOUTS for row in layout_rows(layout, sonar)), map_row(sonar)]
