"""The map behind a thin link: demo.launch in real time, thin_link, and a listener in a network of its own.

Between both lies a pair of virtual cables that carries no more than --kilobits in each direction (tc tbf). Every change
of the map is followed until the listener has it, or a newer one of the same tile. Needs root, ip and tc.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Dict, Iterator, List, Tuple
from zlib import crc32

import numpy as np

from benchmarks.harness import ROOT, Row, benchmark_parser, print_table

_VEHICLE, _TOPSIDE, _MASK = "10.213.77.1", "10.213.77.2", 30
_PACKAGE = "underwater_map_construction"
_DEMO = ("rviz:=false", "real_time_factor:=1.0", "odometry:=dvl")
_WANTED = 10.0  # s
_PATIENCE = 240.0  # s until the graph runs
_LISTEN = "--listen"
Version = Tuple[float, str, int]
"""When a tile came, which one it is, and the checksum of what it shows."""


@contextmanager
def _cable(kilobits: int) -> Iterator[Tuple[str, str]]:
    """Make a network with one computer in it; yield its name and that of the cable's near end."""
    space, near, far = (f"umc{os.getpid()}{end}" for end in ("n", "a", "b"))
    within = ["ip", "netns", "exec", space]
    shaped = ["root", "tbf", "rate", f"{kilobits}kbit", "burst", "4kb", "latency", "2s"]
    try:
        for command in (
            ["ip", "netns", "add", space],
            ["ip", "link", "add", near, "type", "veth", "peer", "name", far, "netns", space],
            ["ip", "address", "add", f"{_VEHICLE}/{_MASK}", "dev", near],
            ["ip", "link", "set", near, "up"],
            [*within, "ip", "address", "add", f"{_TOPSIDE}/{_MASK}", "dev", far],
            [*within, "ip", "link", "set", far, "up"],
            [*within, "ip", "link", "set", "lo", "up"],
            ["tc", "qdisc", "add", "dev", near, *shaped],
            [*within, "tc", "qdisc", "add", "dev", far, *shaped],
        ):
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        yield space, near
    finally:
        subprocess.run(["ip", "netns", "delete", space], check=False, stderr=subprocess.DEVNULL)


def measured(seconds: float, kilobits: int, rate: float) -> List[Row]:
    """Return the rows of so many seconds after the first scan. rate: of thin_link, bytes a second."""
    sys.path.append(str(ROOT / "test/stopping"))
    from stopwatch import free_port

    port = free_port()
    os.environ.update(ROS_MASTER_URI=f"http://{_VEHICLE}:{port}", ROS_IP=_VEHICLE)
    with _cable(kilobits) as (space, near), tempfile.TemporaryDirectory() as folder:
        made, came = Path(folder, "made"), Path(folder, "came")
        of_topside = {**os.environ, "ROS_IP": _TOPSIDE}
        running = [
            _started(["roslaunch", "-p", str(port), _PACKAGE, "demo.launch", *_DEMO, f"map_directory:={folder}"]),
            _started(["roslaunch", "--wait", _PACKAGE, "thin_link.launch", f"bytes_per_second:={rate}"]),
            _started([*_listener(), "MLSM/Markers", str(made)]),
            _started(["ip", "netns", "exec", space, *_listener(), "thin/MLSM/Markers", str(came)], of_topside),
        ]
        try:
            _wait_for(made)
            _wait_for(came)
            before = _sent_bytes(near)
            time.sleep(seconds)
            scans = len({at for at, _, _ in _versions(made)})
            carried = _sent_bytes(near) - before
            time.sleep(_WANTED)
            return [*_rows(_versions(made), _versions(came)), *_of_bytes(carried, scans, seconds)]
        finally:
            for one in reversed(running):
                one.terminate()
                one.wait()


def _listener() -> List[str]:
    return [sys.executable, "-m", "benchmarks.link", _LISTEN]


def _started(command: List[str], environment: Dict[str, str] = os.environ) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def listen(topic: str, path: str) -> None:
    """Write one line for each tile that comes on `topic` to the file `path`, until the process is ended."""
    import rosgraph
    import rospy
    from visualization_msgs.msg import Marker, MarkerArray

    while not rosgraph.is_master_online():
        time.sleep(0.2)
    rospy.init_node("link_bench", anonymous=True)
    with open(path, "w") as file:

        def take(array: MarkerArray) -> None:
            now = time.time()
            for one in array.markers:
                shown = crc32(repr((one.action, [(p.x, p.y, p.z) for p in one.points])).encode())
                if one.action != Marker.DELETEALL:
                    print(json.dumps([now, f"{one.ns} {one.id}", shown]), file=file, flush=True)

        rospy.Subscriber(topic, MarkerArray, take, queue_size=1000)
        rospy.spin()


def _versions(path: Path) -> List[Version]:
    return [tuple(json.loads(line)) for line in path.read_text().splitlines() if line.endswith("]")]


def _rows(made: List[Version], came: List[Version]) -> List[Row]:
    """Return how long changes of the map took to the listener."""
    end = made[-1][0] - _WANTED
    seconds = np.array([_delay(made, came, number) for number, one in enumerate(made) if one[0] < end])
    late = int(np.count_nonzero(seconds > _WANTED))
    figures = f"{np.median(seconds):.1f} s, {np.percentile(seconds, 95):.1f} s, {seconds.max():.1f} s"
    return [
        (f"delay of {len(seconds)} changed tiles, median, 95 %, most", figures, f"<= {_WANTED:g} s"),
        ("tiles that took longer, or never came", str(late), "0"),
    ]


def _delay(made: List[Version], came: List[Version], number: int) -> float:
    """Return after how many seconds the tile that was made, or a newer one, was there; infinity where it was never."""
    at, key, _ = made[number]
    good = {shown for _, other, shown in made[number:] if other == key}
    return next((then - at for then, other, shown in came if then >= at and other == key and shown in good), np.inf)


def _of_bytes(carried: int, scans: int, seconds: float) -> List[Row]:
    return [
        ("bytes on the cable for each change of the map", f"{carried / max(scans, 1):.0f}", ""),
        ("bytes on the cable a second", f"{carried / seconds:.0f}", "less than it carries"),
    ]


def _sent_bytes(device: str) -> int:
    return int(Path(f"/sys/class/net/{device}/statistics/tx_bytes").read_text())


def _wait_for(path: Path) -> None:
    end = time.monotonic() + _PATIENCE
    while not path.exists() or not path.read_text():
        if time.monotonic() > end:
            sys.exit(f"no map on {path.name} after {_PATIENCE:g} s")
        time.sleep(0.5)


def main() -> None:
    """Print the table."""
    if sys.argv[1:2] == [_LISTEN]:
        listen(*sys.argv[2:4])
        return
    parser = benchmark_parser("link", __doc__)
    parser.add_argument("--seconds", type=float, default=180.0, help="how long to measure after the first scan")
    parser.add_argument("--kilobits", type=int, default=256, help="that the link carries in a second")
    parser.add_argument("--rate", type=float, default=24000.0, help="bytes_per_second of thin_link")
    options = parser.parse_args()
    if os.geteuid() or not shutil.which("tc") or not shutil.which("ip"):
        print("link: skipped: it makes a network of its own, which needs root, ip and tc (package iproute2)")
        return
    # The network has to go whoever ends the program.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    print_table(measured(options.seconds, options.kilobits, options.rate))


if __name__ == "__main__":
    main()
