"""map_bag on the real marina, and what that recording itself says of its sonar."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Dict, List

from benchmarks.table import Row
from mlsm_manager.localisation.sensor_model import SensorModel, at_beam_edge
from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.offline.beam_width_calibration import half_width_of, roughness
from mlsm_manager.offline.calibration import Calibrator
from mlsm_manager.offline.echo_shape import echo_shape_of, suited
from mlsm_manager.offline.recording import scans_of
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.ros.bag_recording import BagNames, read_recording

ROOT = Path(__file__).resolve().parents[2]
NAME = "marina_first.bag"
TRUTH = "/ground_truth"
PUBLISHED = "whole run published: 3.99 matching, 1.90 SLAM"


def rows() -> List[Row]:
    """Return all figures; one line that says so where the recording is absent."""
    folder = Path(os.environ.get("UMC_DATA", str(ROOT.parent / "shared/data")))
    bag = folder / NAME
    if not bag.is_file():
        return [("marina", "skipped", f"{NAME} is not in {folder}; set UMC_DATA")]
    plain, refined = _mapped(bag), _mapped(bag, "--refine")
    return [
        ("marina: scans, matched, rejected", f"{plain['scans']}, {plain['matched']}, {plain['rejected']}", ""),
        _error_row("dead reckoning", plain["dead_reckoning"], PUBLISHED),
        _error_row("corrected, causal", plain["corrected"], "mean < 1.6, max < 4.5"),
        _error_row("refined", refined["refined"], "mean < 1.4, max < 3.5"),
        ("marina: speed", f"{plain['times_real_time']} times real time", ">= 100"),
        ("marina: speed with --refine", f"{refined['times_real_time']} times real time", ""),
        *_calibration_rows(bag),
    ]


def _mapped(bag: Path, *options: str) -> Dict[str, Any]:
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, str(ROOT / "nodes/map_bag"), str(bag), "--out", out, "--truth", TRUTH, *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return json.loads((Path(out) / "summary.json").read_text())


def _error_row(name: str, error: Dict[str, float], wanted: str) -> Row:
    return f"marina: {name}, mean / max", f"{error['mean']:.2f} / {error['max']:.2f} m", wanted


def _calibration_rows(bag: Path) -> List[Row]:
    """Return the residuals that decide the sensor model; the truth is not read."""
    recording = read_recording(bag, BagNames("/sonar/raw", "odom", "base_link", None))
    form = echo_shape_of([placed.beam for placed in recording.beams])
    parameters = suited(ReplayParameters(range_scale_deviation=0.0), form, fixed=())
    scans = [scan for scan, _ in scans_of(recording, parameters.echoes())]
    width = half_width_of(scans)
    result: List[Row] = []
    for tried in (0.0, 0.03, round(width, 3), 0.09):
        rough = sum(roughness(at_beam_edge(scan, tried)) for scan in scans) / len(scans)
        result.append((f"marina: log thickness of walls, half width {tried}", f"{rough:.3f}", "least at the one taken"))
    matcher = parameters.changed({"edge_half_width": width}).build_matcher()
    calibrator = Calibrator(matcher, parameters.part(OdometryErrors), parameters.match_resolution)
    for delay in (0.0, 0.9):
        found = calibrator.delay([SensorModel(delay, 1.0, width).applied(scan) for scan in scans])
        result.append(
            (f"marina: delay that is left with {delay} s", f"{found.value:.2f} +- {found.deviation:.2f} s", "")
        )
    found = calibrator.scale([SensorModel(0.9, 1.0, width).applied(scan) for scan in scans])
    result.append(
        ("marina: sonar longer than odometry", f"{100 * found.value:.1f} +- {100 * found.deviation:.1f} %", "")
    )
    return result
