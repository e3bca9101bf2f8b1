"""What the graph says of itself, and what a listener counts beside it."""

import math
import re
import threading
from collections import Counter, deque
from typing import Deque, Dict, List, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock, Log
from std_msgs.msg import Float32

from node_support.ros.callbacks import INTERNAL_ERRORS

COUNTED = {
    "/sonar/scan/echoes": (("echo_extractor", "clouds out"), ("mlsm_core", "scans in")),
    "/MLSM/pose": (("mlsm_core", "scans matched"),),
}
"""Topics whose messages are counted, and the counters of nodes that must tell the same number."""
_SENT, _ARRIVED, _LOST = "beams out", "beams placed", "beams without transform"
_TRUTHS = 2000  # a hundred seconds of the simulated clock: fixes come late
_DIGITS = re.compile(r"-?\d+(\.\d+)?")


class Listener:
    """Safe to look at while messages come.

    lines: of the log, with their simulated hour. errors_said: node and text of those of level ERROR and above.
    """

    def __init__(self) -> None:
        self.now = self.start = float("nan")
        self.progress = 0.0
        self.lines: List[Tuple[float, str]] = []
        self.errors_said: List[Tuple[str, str]] = []
        self.counts: Dict[str, int] = dict.fromkeys(COUNTED, 0)
        self.errors: List[Tuple[float, float, float]] = []
        self._stages: Dict[str, Dict[str, str]] = {}
        self._complaints: Counter = Counter()
        self._truth: Deque[Tuple[int, float, float]] = deque(maxlen=_TRUTHS)
        self._fixes: Deque[Tuple[int, float, float, float]] = deque()
        self._lock = threading.Lock()
        rospy.Subscriber("/sonar/scan/echoes", rospy.AnyMsg, self._count, callback_args="/sonar/scan/echoes")
        rospy.Subscriber("/clock", Clock, self._take_clock)
        rospy.Subscriber("/rosout_agg", Log, self._take_line)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._take_diagnostics)
        rospy.Subscriber("/sonar_simulator/progress", Float32, self._take_progress, queue_size=1)
        rospy.Subscriber("/ground_truth", Odometry, self._take_truth)
        rospy.Subscriber("/MLSM/pose", PoseWithCovarianceStamped, self._take_pose)

    @property
    def hours(self) -> float:
        """Simulated hours since the first message of the clock; 0 before it."""
        return (self.now - self.start) / 3600.0 if self.start == self.start else 0.0

    def value(self, stage: str, counter: str, untold: int = -1) -> int:
        """Return a counter as a stage told it last; `untold` where it told none."""
        with self._lock:
            return int(self._stages.get(stage, {}).get(counter, untold))

    @property
    def match_time(self) -> float:
        """What the newest scan cost the solver, ms of the wall clock; NaN before the first."""
        with self._lock:
            return float(self._stages.get("mlsm_core", {}).get("match time [ms]", "nan"))

    @property
    def has_begun(self) -> bool:
        """Whether the clock runs and the map's node tells of itself."""
        return self.start == self.start and self.value("mlsm_core", "blocks") >= 0

    @property
    def waiting(self) -> int:
        """How many beams are on their way: sent, neither placed nor lost."""
        return self.value("sonar_simulator", _SENT) - self.value("sonar_to_cloud", _ARRIVED) - self.lost

    @property
    def lost(self) -> int:
        """How many beams were dropped because too many newer ones waited, or tf did not place them."""
        return self.value("sonar_to_cloud", _LOST, untold=0)

    def internal_errors(self) -> Dict[str, int]:
        """Return how many internal errors each stage counts, of those that count any."""
        with self._lock:
            told = {name: int(values.get(INTERNAL_ERRORS, 0)) for name, values in self._stages.items()}
        return {name: count for name, count in told.items() if count}

    def complaints(self) -> List[Tuple[str, int]]:
        """Return in which words stages told another level than OK, and how often."""
        with self._lock:
            return self._complaints.most_common()

    def _count(self, _: object, topic: str) -> None:
        with self._lock:
            self.counts[topic] += 1

    def _take_clock(self, clock: Clock) -> None:
        self.now = clock.clock.to_sec()
        if self.start != self.start:
            self.start = self.now

    def _take_progress(self, progress: Float32) -> None:
        self.progress = progress.data

    def _take_line(self, log: Log) -> None:
        self.lines.append((self.hours, f"{log.name}: {_DIGITS.sub('N', log.msg)}"))
        if log.level >= Log.ERROR:
            self.errors_said.append((log.name, log.msg))

    def _take_diagnostics(self, diagnostics: DiagnosticArray) -> None:
        with self._lock:
            for status in diagnostics.status:
                name = status.name.rpartition(": ")[2]
                self._stages[name] = {item.key: item.value for item in status.values}
                if status.level:
                    self._complaints[f"{name}: {_DIGITS.sub('N', status.message)}"] += 1

    def _take_truth(self, odometry: Odometry) -> None:
        """Remember where the vehicle is, and compare the fixes from before with where it was."""
        place, stamp = odometry.pose.pose.position, odometry.header.stamp.to_nsec()
        with self._lock:
            self._truth.append((stamp, place.x, place.y))
            while self._fixes and self._fixes[0][0] <= stamp:
                self._compare(*self._fixes.popleft())

    def _take_pose(self, pose: PoseWithCovarianceStamped) -> None:
        self._count(pose, "/MLSM/pose")
        place, covariance, stamp = pose.pose.pose.position, pose.pose.covariance, pose.header.stamp.to_nsec()
        with self._lock:
            self._fixes.append((stamp, place.x, place.y, (covariance[0] + covariance[7]) ** 0.5))

    def _compare(self, stamp: int, x: float, y: float, told: float) -> None:
        _, true_x, true_y = min(self._truth, key=lambda one: abs(one[0] - stamp))
        self.errors.append((self.hours, math.hypot(x - true_x, y - true_y), told))
