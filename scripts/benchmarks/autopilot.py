"""How old a position is when an emulated autopilot gets it: demo.launch in real time, autopilot_link, UDP.

The age of a position is the time from the beam, at whose stamp the vehicle has it, to its arrival. That of a fix is the
time from the last beam of its scan to the arrival of the first position that has it.
"""

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import Any, Callable, Iterator, List, Tuple

import numpy as np

from benchmarks.harness import ROOT, Row, benchmark_parser, print_table

sys.path.append(str(ROOT / "test/rostest"))
sys.path.append(str(ROOT / "test/stopping"))

_DEMO = ("rviz:=false", "real_time_factor:=1.0", "odometry:=dvl")
_PATIENCE = 180.0  # s until the graph runs
_WANTED = "<= 150 ms at 95 %"


@contextmanager
def _graph(master: int, autopilot: int) -> Iterator[None]:
    """Run the simulated vehicle with its link, under a master of its own."""
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{master}"
    package = "underwater_map_construction"
    commands = [
        ["roslaunch", "-p", str(master), package, "demo.launch", *_DEMO],
        ["roslaunch", "--wait", package, "autopilot_link.launch", f"connection:=udpin:127.0.0.1:{autopilot}"],
    ]
    running = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for command in commands]
    try:
        yield
    finally:
        for one in reversed(running):
            one.terminate()
            one.wait()


def measured(seconds: float) -> List[Row]:
    """Return the rows of a run of so many seconds after the first position."""
    from stopwatch import free_port

    master, autopilot = free_port(), free_port()
    with _graph(master, autopilot):
        import rosgraph
        import rospy
        from autopilot_peer import Peer
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from nav_msgs.msg import Odometry

        _wait(lambda: rosgraph.is_master_online() and rosgraph.Master("/bench").hasParam("/use_sim_time"))
        rospy.init_node("autopilot_bench", anonymous=True, disable_signals=True)
        odometry, fixes = Arrivals("/odom", Odometry), Arrivals("/MLSM/pose", PoseWithCovarianceStamped)
        peer = Peer(f"udpin:127.0.0.1:{autopilot}", clock=lambda: rospy.get_rostime().to_nsec())
        _wait(lambda: bool(peer.of_type("ODOMETRY")))
        time.sleep(seconds)
        peer.close()
        return _rows(peer, odometry.table(), fixes.table())


class Arrivals:
    """When the messages of a topic came."""

    def __init__(self, topic: str, kind: type) -> None:
        import rospy

        self._rows: List[Tuple[float, float]] = []
        rospy.Subscriber(topic, kind, self._take, queue_size=1000, tcp_nodelay=True)

    def _take(self, message: Any) -> None:
        self._rows.append((message.header.stamp.to_sec(), time.monotonic()))

    def table(self) -> np.ndarray:
        """Return (n, 2) s: stamps, and arrivals by this machine's clock."""
        return np.array(self._rows)


def _rows(peer: Any, odometry: np.ndarray, fixes: np.ndarray) -> List[Row]:
    pairs = [(at, one) for at, one in zip(peer.arrivals, peer.received) if one.get_type() == "ODOMETRY"]
    arrived = np.array([at for at, _ in pairs])
    stamps = np.array([one.time_usec for _, one in pairs]) * 1e-6 - peer.ahead_ns * 1e-9
    following = np.searchsorted(arrived, fixes[:, 1])
    known = following < len(arrived)
    ages = arrived - _moments(stamps, odometry)
    fix_ages = arrived[following[known]] - _moments(fixes[known, 0], odometry)
    rate = (len(arrived) - 1) / (arrived[-1] - arrived[0])
    return [
        (f"age of {len(ages)} positions on arrival, median and 95 %", _told(ages), _WANTED),
        (f"age of {len(fix_ages)} fixes on arrival, median and 95 %", _told(fix_ages), "as the solver needs"),
        ("positions a second", f"{rate:.1f}", "10"),
    ]


def _moments(stamps: np.ndarray, odometry: np.ndarray) -> np.ndarray:
    """Return when the simulated moments (n,) s were, by this machine's clock: simulated time goes in steps."""
    nearest = np.abs(stamps[:, np.newaxis] - odometry[:, 0]).argmin(axis=1)
    return odometry[nearest, 1]


def _told(seconds: np.ndarray) -> str:
    return " and ".join(f"{1e3 * value:.0f} ms" for value in np.percentile(seconds, [50.0, 95.0]))


def _wait(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + _PATIENCE
    while not holds():
        if time.monotonic() > end:
            sys.exit(f"the graph does not run after {_PATIENCE:g} s")
        time.sleep(0.1)


def main() -> None:
    """Print the table."""
    parser = benchmark_parser("autopilot", __doc__)
    parser.add_argument("--seconds", type=float, default=120.0, help="how long to measure after the first position")
    print_table(measured(parser.parse_args().seconds))


if __name__ == "__main__":
    main()
