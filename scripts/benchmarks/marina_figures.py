"""map_bag on the real marina: errors, speed, and what the run says of itself."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Dict, List

from benchmarks.recorded import ROOT, recorded
from benchmarks.table import Row

NAME = "marina_first.bag"
TRUTH = "/ground_truth"
PUBLISHED = "whole run published: 3.99 matching, 1.90 SLAM"


def rows() -> List[Row]:
    """Return all figures; one line that says so where the recording is absent."""
    bag = recorded(NAME)
    if not bag.is_file():
        return [("marina", "skipped", f"{NAME} is not in {bag.parent}; set UMC_DATA")]
    plain, refined = _mapped(bag), _mapped(bag, "--refine")
    return [
        ("marina: scans, matched, rejected", f"{plain['scans']}, {plain['matched']}, {plain['rejected']}", ""),
        _error_row("dead reckoning", plain["dead_reckoning"], PUBLISHED),
        _error_row("corrected, causal", plain["corrected"], "mean < 1.6, max < 4.5"),
        _error_row("refined", refined["refined"], "mean < 1.4, max < 3.5"),
        ("marina: speed", f"{plain['times_real_time']} times real time", ">= 100"),
        ("marina: speed with --refine", f"{refined['times_real_time']} times real time", ""),
        *_calibration_rows(refined),
    ]


def _mapped(bag: Path, *options: str) -> Dict[str, Any]:
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, str(ROOT / "nodes/map_bag"), str(bag), "--out", out, "--truth", TRUTH, *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return json.loads((Path(out) / "summary.json").read_text())


def _error_row(name: str, error: Dict[str, float], wanted: str) -> Row:
    return f"marina: {name}, mean / max", f"{error['mean']:.2f} / {error['max']:.2f} m", wanted


def _calibration_rows(summary: Dict[str, Any]) -> List[Row]:
    """Return what the run found of sonar and odometry, and what it says of itself; no truth is in them."""
    found = [
        (f"marina: {name}", f"{one['value']:.4f} +- {one['deviation']:.4f}", "")
        for name, one in summary["calibration"].items()
    ]
    checks = [
        (f"marina: {name}", f"{one['value']}", f"limit {one['limit']}") for name, one in summary["checks"].items()
    ]
    return [*found, *checks]
