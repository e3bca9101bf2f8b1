"""map_bag as it is run, a process of its own."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
BASIN = ROOT / "test/data/basin.bag"
COMMAND = [sys.executable, str(ROOT / "nodes/map_bag")]


def run(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False)


def refused(*arguments):
    """Return the one line with which map_bag refuses."""
    done = run(*arguments)
    lines = done.stderr.strip().splitlines()
    assert (done.returncode, len(lines)) == (1, 1), done.stderr
    return lines[0]


def summary_of(folder):
    return json.loads((folder / "summary.json").read_text())
