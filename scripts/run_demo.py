"""Runs the demo's graph on a master of its own, tells how it goes, and leaves its results."""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional

import numpy as np
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from std_msgs.msg import Float32

from mlsm_manager.offline.picture import draw_map
from mlsm_manager.report.mission import Path as Trajectory
from mlsm_manager.surface_map.map_file import read_map
from node_support.files import write_whole
from sonar_simulator.world.world_file import load_world
from underwater_map_construction.srv import SaveMap

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "underwater_map_construction"
STAGES = ("sonar_to_cloud", "thresholder", "outlier_remover", "mlsm_core")
START_TIMEOUT = 30.0
FINISH_TIMEOUT = 150.0
STOP_TIMEOUT = 10.0


class DemoError(RuntimeError):
    """The demo cannot go on; the text says why."""


class Graph:
    """roslaunch in a process group of its own, so that nothing outlives the demo."""

    def __init__(self, arguments: List[str], log: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("localhost", 0))
            port = probe.getsockname()[1]
        os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
        command = ["roslaunch", "-p", str(port), PACKAGE, "demo.launch", *arguments]
        self._log = log
        with log.open("wb") as output:
            self._process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)

    @property
    def pid(self) -> int:
        """Of roslaunch."""
        return self._process.pid

    def check(self) -> None:
        """Raise DemoError when roslaunch has ended."""
        if self._process.poll() is not None:
            tail = "\n".join(self._log.read_text(errors="replace").splitlines()[-15:])
            raise DemoError(f"roslaunch ended with status {self._process.returncode}:\n{tail}")

    def wait_for_master(self) -> None:
        """Wait until the master answers; raises DemoError."""
        deadline = time.monotonic() + START_TIMEOUT
        while not rosgraph.is_master_online():
            self.check()
            if time.monotonic() > deadline:
                raise DemoError(f"no master after {START_TIMEOUT:.0f} s")
            time.sleep(0.1)

    def stop(self) -> None:
        """End roslaunch and all that it started."""
        for number, patience in ((signal.SIGINT, STOP_TIMEOUT), (signal.SIGKILL, 1.0)):
            if self._process.poll() is None:
                os.killpg(self._process.pid, number)
                try:
                    self._process.wait(patience)
                except subprocess.TimeoutExpired:
                    continue


class Watch:
    """Listens to the graph: progress, the true path and the counters of the stages."""

    def __init__(self) -> None:
        self.progress = 0.0
        self.path: List[List[float]] = []
        self.stages: Dict[str, Dict[str, str]] = {}
        rospy.Subscriber("/sonar_simulator/progress", Float32, self._take_progress, queue_size=10)
        rospy.Subscriber("/ground_truth", Odometry, self._take_truth, queue_size=100)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._take_diagnostics, queue_size=10)

    def _take_progress(self, message: Float32) -> None:
        self.progress = message.data

    def _take_truth(self, message: Odometry) -> None:
        position = message.pose.pose.position
        self.path.append([message.header.stamp.to_sec(), position.x, position.y])

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.stages[status.name.rpartition(": ")[2]] = {item.key: item.value for item in status.values}

    def number(self, stage: str, counter: str) -> int:
        """Return a stage's counter, 0 while it has not counted."""
        return int(self.stages.get(stage, {}).get(counter, 0))

    @property
    def is_settled(self) -> bool:
        """Whether the script is done and every scan has arrived in the map."""
        scans = self.number("sonar_to_cloud", "scans")
        # A busy machine may lose a beam, which then never arrives.
        ended = sum(self.number("sonar_to_cloud", counter) for counter in ("beams placed", "beams without transform"))
        all_beams = ended > 0 and ended == self.number("sonar_simulator", "beams out")
        return self.progress >= 1.0 and all_beams and self.number("mlsm_core", "clouds in") == scans


def follow(graph: Graph, watch: Watch) -> float:
    """Print the progress until the last scan is in the map; return the seconds of wall time. Raises DemoError."""
    start = time.monotonic()
    next_line = start
    while not watch.is_settled:
        graph.check()
        now = time.monotonic()
        if now - start > FINISH_TIMEOUT:
            raise DemoError(f"not finished after {FINISH_TIMEOUT:.0f} s, at {100 * watch.progress:.0f} %")
        if now >= next_line:
            scans, blocks = watch.number("mlsm_core", "clouds in"), watch.number("mlsm_core", "blocks")
            print(f"demo: {100 * watch.progress:3.0f} %  {scans:3d} scans  {blocks:5d} blocks", flush=True)
            next_line = now + 2.0
        time.sleep(0.1)
    return time.monotonic() - start


def summary(watch: Watch, seconds: float) -> Dict[str, Any]:
    """Return what summary.json holds."""
    simulated = watch.path[-1][0] - watch.path[0][0] if watch.path else 0.0
    stages = {
        name: {key: watch.number(name, key) for key in ("points in", "points out", "points inserted")
               if key in watch.stages.get(name, {})}
        for name in STAGES
    }  # fmt: skip
    return {
        "scans": watch.number("mlsm_core", "clouds in"),
        "beams": watch.number("sonar_to_cloud", "beams in"),
        "beams_without_transform": watch.number("sonar_to_cloud", "beams without transform"),
        "stages": {name: {key.replace(" ", "_"): value for key, value in s.items()} for name, s in stages.items()},
        "blocks": watch.number("mlsm_core", "blocks"),
        "seconds": round(seconds, 2),
        "times_real_time": round(simulated / seconds, 2),
    }


def leave_results(watch: Watch, seconds: float, output: Path) -> None:
    """Save the map, draw it and write the summary. Raises DemoError."""
    answer = rospy.ServiceProxy("/mlsm_core/save_map", SaveMap)("map", True)
    if not answer.success:
        raise DemoError(answer.message)
    blocks = read_map(output / "map.mlsm").shown
    outlines = load_world(ROOT / "worlds/basin.sdf").outlines()
    # No line leads from one outline to the next.
    lines = np.concatenate([np.append(np.asarray(one)[:, :2], [[np.nan, np.nan]], axis=0) for one in outlines])
    walls = Trajectory("walls as they are", "#1f5fa8", np.zeros(len(lines)), lines)
    poses = np.array(watch.path)
    path = Trajectory("the vehicle's path", "#2a9d4a", poses[:, 0], poses[:, 1:])
    title = f"The basin as {watch.number('mlsm_core', 'clouds in')} scans show it"
    draw_map(output / "map.png", title, blocks, [walls, path])
    write_whole(output / "summary.json", (json.dumps(summary(watch, seconds), indent=2) + "\n").encode())


def run(arguments: argparse.Namespace) -> None:
    """Run the demo from start to end. Raises DemoError."""
    output = arguments.output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    show = bool(os.environ.get("DISPLAY")) and not arguments.no_rviz
    settings = {"rviz": str(show).lower(), "map_directory": str(output), "real_time_factor": arguments.factor}
    graph = Graph([f"{key}:={value}" for key, value in settings.items()], output / "roslaunch.log")
    try:
        graph.wait_for_master()
        rospy.init_node("demo", anonymous=True, disable_signals=True)
        watch = Watch()
        shown = "rviz shows the map while it grows" if show else "no screen, so without rviz"
        print(f"demo: {shown}; {arguments.factor:g} times real time", flush=True)
        seconds = follow(graph, watch)
        leave_results(watch, seconds, output)
    finally:
        graph.stop()
    print((output / "summary.json").read_text(), end="")
    print(f"demo: done; map.mlsm, map.png and summary.json are in {output}")


def status_of(name: str, work: Callable[[], Optional[int]]) -> int:
    """Return the exit status of what a program does; what ends it is said in one line."""
    try:
        return work() or 0
    except DemoError as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"{name}: stopped", file=sys.stderr)
        return 130


def main() -> int:
    """Parse the command line and run; return the exit status."""
    parser = argparse.ArgumentParser(prog="scripts/demo", description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "demo_output", help="folder of the results")
    parser.add_argument("--factor", type=float, default=10.0, help="times real time")
    parser.add_argument("--no-rviz", action="store_true", help="no window, even with a screen")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    options = parser.parse_args()
    return status_of("demo", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
