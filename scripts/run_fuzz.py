"""Runs the rostests of random messages with many messages and prints what they found."""

import argparse
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import List

ROOT = Path(__file__).resolve().parents[1]
TESTS = ("fuzz_one_process", "fuzz_many_processes")
# s for a message on a busy machine, and for the start of the nodes.
SECONDS_PER_MESSAGE, START = 0.02, 200.0
# What Python prints of an exception that nobody caught, and roslaunch of a node that ended.
BAD_LINES = ("Traceback (most recent call last)", "has died")


def main() -> int:
    """Run both tests; return the exit status."""
    parser = argparse.ArgumentParser(prog="scripts/fuzz", description=__doc__)
    parser.add_argument("messages", type=int, nargs="?", default=200000, help="half of them go to one process")
    parser.add_argument("seed", type=int, nargs="?", default=1, help="of all random numbers")
    options = parser.parse_args()
    return max(_run(test, options.messages // 2, options.seed) for test in TESTS)


def _run(test: str, messages: int, seed: int) -> int:
    limit = START + SECONDS_PER_MESSAGE * messages
    arguments = [f"messages:={messages}", f"seed:={seed}", f"time_limit:={limit:.0f}"]
    with tempfile.TemporaryDirectory() as results:
        done = subprocess.run(
            ["rostest", f"{ROOT}/test/rostest/{test}.test", *arguments],
            env={**os.environ, "ROS_TEST_RESULTS_DIR": results},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
        )  # fmt: skip
        bad = [line for line in done.stdout.splitlines() if any(sign in line for sign in BAD_LINES)]
        reports = [ET.parse(str(path)).getroot() for path in sorted(Path(results).rglob("rosunit-*.xml"))]
    failures = [item.text or "" for report in reports for kind in ("failure", "error") for item in report.iter(kind)]
    failed = done.returncode != 0 or bool(failures) or bool(bad) or not reports
    print(f"{test}: {'FAILED' if failed else 'ok'}", *_printed(reports), *failures, *bad, sep="\n  ", flush=True)
    if failed:
        print(done.stdout)
    return int(failed)


def _printed(reports: List[ET.Element]) -> List[str]:
    """Return the lines that the tests printed."""
    texts = [item.text or "" for report in reports for item in report.iter("system-out")]
    lines = [line.strip() for text in texts for line in text.splitlines()]
    # rosunit writes the marks of CDATA as text.
    return [line for line in lines if line not in ("", "<![CDATA[", "]]>")]


if __name__ == "__main__":
    sys.exit(main())
