"""scripts/soak: a mission of many hours through the live graph, and what grew in the course of it."""

import argparse
import os
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import List

import numpy as np
import rospy
import yaml
from benchmarks.harness import print_rows
from run_demo import ROOT, DemoError, Graph, status_of

from soaking.listening import Listener
from soaking.processes import held_below
from soaking.verdicts import Sample, rows

_BACK = {"x": 18, "y": -11, "yaw_deg": 250 - 360, "seconds": 31.6}
"""From the end of the basin's tour to its start."""
_FACTOR = 15.0  # times real time: what a machine can that is not busy, also while the map's node starts
_BETWEEN_SAMPLES = 1.0 / 60.0  # h, simulated
_AT_REST = 5.0  # s of the wall clock after the last beam, in which /diagnostics tells of it
_LATE = 120.0  # s of the wall clock after the simulation, until which the last scan is in the map
_STALLED = 300.0  # s of the wall clock without progress


def soak(options: argparse.Namespace, folder: Path) -> bool:
    """Run the graph for so many simulated hours, or until Ctrl-C; print what it took, return whether all is as wanted.

    Raises DemoError when it does not go on.
    """
    script = folder / "moves.yaml"
    script.write_text(_laps(options.hours))
    os.environ["ROS_LOG_DIR"] = str(folder / "logs")
    settings = {"script": script, "map_directory": folder / "maps", "rviz": "false", "real_time_factor": _FACTOR}
    arguments = [f"{name}:={value}" for name, value in settings.items()]
    graph = Graph([*arguments, "odometry_error:=0.02", *options.arguments], folder / "roslaunch.log")
    try:
        graph.wait_for_master()
        rospy.init_node("soak", anonymous=True, disable_signals=True)
        listener = Listener()
        samples: List[Sample] = []
        try:
            _sample_all(graph, listener, folder, samples)
            _wait_for_rest(listener)
        except KeyboardInterrupt:
            if not samples:
                raise
            print(f"soak: stopped after {listener.hours:.1f} h; what has been until then:", file=sys.stderr)
        table = rows(samples, listener, (folder / "roslaunch.log").read_text(errors="replace"))
        print_rows(row[:3] for row in table)
        for row in (row for row in table if not row.holds):
            print(f"soak: {row.what}: {row.measured}, wanted {row.wanted}", file=sys.stderr)
        return all(row.holds for row in table)
    finally:
        graph.stop()


def _laps(hours: float) -> str:
    """Return a script of moves, as YAML, that repeats the demo's tour for `hours` or a little longer."""
    script = yaml.safe_load((ROOT / "yaml/basin_tour.yaml").read_text())
    lap = [*script["moves"], _BACK]
    ends = np.cumsum([move.get("seconds", 0.0) + move.get("wait", 0.0) for move in lap])
    laps, rest = divmod(3600.0 * hours, ends[-1])
    moves = lap * int(laps) + lap[: int(np.searchsorted(ends, rest)) + 1]
    return yaml.safe_dump({"start": script["start"], "moves": moves})


def _sample_all(graph: Graph, listener: Listener, folder: Path, samples: List[Sample]) -> None:
    """Append a sample for each simulated minute of the run; print one an hour."""
    hour, progress, moved = 0, 0.0, time.monotonic()
    while listener.progress < 1.0:
        graph.check()
        time.sleep(0.2)
        if listener.progress > progress:
            progress, moved = listener.progress, time.monotonic()
        if time.monotonic() - moved > _STALLED:
            raise DemoError(f"no progress for {_STALLED:.0f} s at {100 * progress:.1f} %")
        if listener.has_begun and (not samples or listener.hours >= samples[-1].hours + _BETWEEN_SAMPLES):
            samples.append(_sample(graph, listener, folder))
            if samples[-1].hours >= hour:
                samples[-1].tell(samples[0], has_heading=hour == 0)
                hour += 1
    samples.append(_sample(graph, listener, folder))
    samples[-1].tell(samples[0])


def _wait_for_rest(listener: Listener) -> None:
    """Wait until all beams have arrived and nothing changes any more, but not for ever."""
    end, before = time.monotonic() + _LATE, {}
    while time.monotonic() < end and (listener.waiting or listener.counts != before):
        before = dict(listener.counts)
        time.sleep(_AT_REST)


def _sample(graph: Graph, listener: Listener, folder: Path) -> Sample:
    disk = sum(one.stat().st_size for one in folder.rglob("*") if one.is_file()) / 1e6
    scans, blocks = (listener.value("mlsm_core", each) for each in ("scans in", "blocks"))
    held = held_below(graph.pid)
    return Sample(
        listener.hours, time.monotonic(), held, listener.waiting, disk, blocks, max(scans, 0), listener.match_time
    )


def main() -> int:
    """Parse the command line and run; return the exit status."""
    parser = argparse.ArgumentParser(prog="scripts/soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="simulated ones (default: %(default)g)")
    parser.add_argument("--output", type=Path, help="folder that keeps logs and maps; none: they are removed")
    parser.add_argument("arguments", nargs="*", metavar="NAME:=VALUE", help="arguments of demo.launch")
    options = parser.parse_args()
    folder = options.output or Path(tempfile.mkdtemp())
    # Also where a shell has started it in the background.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    (folder / "maps").mkdir(parents=True, exist_ok=True)
    try:
        return status_of("soak", lambda: int(not soak(options, folder.resolve())))
    finally:
        if options.output is None:
            shutil.rmtree(str(folder), ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
