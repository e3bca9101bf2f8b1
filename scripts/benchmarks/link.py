"""The map behind a thin link: demo.launch in real time, thin_link, and a listener in a network of its own.

Between both lies a pair of virtual cables that carries no more than 256 kbit/s in each direction (tc tbf). Every change
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

from benchmarks.cable import TOPSIDE, WANTED, delays, demo_behind, versions, wait_for
from benchmarks.harness import Row

LISTENER = [sys.executable, "-m", "benchmarks.link"]
"""The command that follows tiles, without the topic and the file to which it writes them."""


def rows(seconds: float = 180.0) -> List[Row]:
    """Return the rows of so many seconds after the first scan."""
    with tempfile.TemporaryDirectory() as folder, demo_behind(folder) as (cable, programs):
        made, came = Path(folder, "made"), Path(folder, "came")
        programs.launch("thin_link.launch")
        programs.start(*LISTENER, "MLSM/Markers", made)
        programs.start(*cable.far_end, *LISTENER, "thin/MLSM/Markers", came, ROS_IP=TOPSIDE)
        wait_for(made)
        wait_for(came)
        before = cable.sent_bytes
        time.sleep(seconds)
        scans = len({at for at, _, _ in versions(made)})
        carried = cable.sent_bytes - before
        time.sleep(WANTED)
        changes = versions(made)
        numbers = [number for number, (at, _, _) in enumerate(changes) if at < changes[-1][0] - WANTED]
        row, late = delays(changes, versions(came), numbers)
    return [
        row,
        ("tiles that took longer, or never came", f"{np.count_nonzero(late > WANTED)}", "0"),
        ("bytes on the cable for each change of the map", f"{carried / max(scans, 1):.0f}", ""),
        ("bytes on the cable a second", f"{carried / seconds:.0f}", "less than it carries"),
    ]


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


if __name__ == "__main__":
    listen(*sys.argv[1:])
