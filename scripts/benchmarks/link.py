"""The map behind a thin link: demo.launch in real time, thin_link, and a listener in a network of its own.

Between both lies a pair of virtual cables that carries no more than --kilobits in each direction (tc tbf). Every change
of the map is followed until the listener has it, or a newer one of the same tile. Needs root, ip and tc.
"""

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import List
from zlib import crc32

import numpy as np

from benchmarks.cable import TOPSIDE, Version, arrivals, cannot_be_laid, demo_behind, told, versions, wait_for
from benchmarks.harness import Row, benchmark_parser, print_table
from benchmarks.programs import study

_WANTED = 10.0  # s
_LISTEN = "--listen"
LISTENER = [*study("link"), _LISTEN]
"""The command that follows tiles, without the topic and the file to which it writes them."""


def measured(seconds: float, kilobits: int, rate: float) -> List[Row]:
    """Return the rows of so many seconds after the first scan. rate: of thin_link, bytes a second."""
    with tempfile.TemporaryDirectory() as folder, demo_behind(kilobits, folder) as (cable, programs):
        made, came = Path(folder, "made"), Path(folder, "came")
        programs.launch("thin_link.launch", f"bytes_per_second:={rate}")
        programs.start(*LISTENER, "MLSM/Markers", made)
        programs.start(*cable.far_end, *LISTENER, "thin/MLSM/Markers", came, ROS_IP=TOPSIDE)
        wait_for(made)
        wait_for(came)
        before = cable.sent_bytes
        time.sleep(seconds)
        scans = len({at for at, _, _ in versions(made)})
        carried = cable.sent_bytes - before
        time.sleep(_WANTED)
        return [*rows(versions(made), versions(came)), *_of_bytes(carried, scans, seconds)]


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


def rows(made: List[Version], came: List[Version]) -> List[Row]:
    """Return how long changes of the map took to the listener."""
    numbers = [number for number, one in enumerate(made) if one[0] < made[-1][0] - _WANTED]
    seconds = arrivals(made, came, numbers) - np.array([made[number][0] for number in numbers])
    late = int(np.count_nonzero(seconds > _WANTED))
    return [
        (f"delay of {len(seconds)} changed tiles, median, 95 %, most", told(seconds), f"<= {_WANTED:g} s"),
        ("tiles that took longer, or never came", str(late), "0"),
    ]


def _of_bytes(carried: int, scans: int, seconds: float) -> List[Row]:
    return [
        ("bytes on the cable for each change of the map", f"{carried / max(scans, 1):.0f}", ""),
        ("bytes on the cable a second", f"{carried / seconds:.0f}", "less than it carries"),
    ]


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
    if not cannot_be_laid("link"):
        print_table(measured(options.seconds, options.kilobits, options.rate))
