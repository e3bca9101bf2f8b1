"""How much of a core map_bag takes for a whole real run; no truth is read."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import List, Tuple

from benchmarks.recorded import ROOT, recorded
from benchmarks.table import Row

NAME = "marina_whole_blind.bag"
_WANTED = {"": 500, "--refine": 150, "--refine --check": 150}
"""Times real time that are wanted, by the options."""


def rows() -> List[Row]:
    """Return CPU time and times real time for each set of options; one line that says so without the recording."""
    bag = recorded(NAME)
    if not bag.is_file():
        return [("map_bag", "skipped", f"{NAME} is not in {bag.parent}; set UMC_DATA")]
    return [_row(bag, options, wanted) for options, wanted in _WANTED.items()]


def _row(bag: Path, options: str, wanted: int) -> Row:
    cpu, length = _spent(bag, *options.split())
    name = " ".join(["map_bag", NAME, *options.split()])
    return name, f"{cpu:.1f} s CPU, {length / cpu:.0f} times real time", f">= {wanted}"


def _spent(bag: Path, *options: str) -> Tuple[float, float]:
    """Return the CPU seconds of a run with its imports, and how many seconds were recorded."""
    with tempfile.TemporaryDirectory() as out:
        before = os.times()
        command = [sys.executable, str(ROOT / "nodes/map_bag"), str(bag), "--out", out, *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        after = os.times()
        summary = json.loads((Path(out) / "summary.json").read_text())
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return cpu, summary["times_real_time"] * summary["seconds"]
