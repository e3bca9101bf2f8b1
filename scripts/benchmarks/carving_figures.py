"""What carving costs of a scan of real recordings, with either estimator."""

import os
import time
from pathlib import Path
from typing import List

import numpy as np

from benchmarks.table import Row
from mlsm_manager.localisation.joint_parameters import EstimatorName
from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.offline.bag_recording import read_recording
from mlsm_manager.offline.map_bag_arguments import map_bag_arguments
from mlsm_manager.offline.odometry_kind import odometry_of, with_odometry
from mlsm_manager.offline.recording import scans_of
from mlsm_manager.scan_matching.scan import Scan

ROOT = Path(__file__).resolve().parents[2]
NAME = "marina_first.bag"
_WARM_UP = 10
"""Scans until there is a map to be matched with and free space to be known."""


def rows() -> List[Row]:
    """Return the share of each estimator; one line that says so where the recording is absent."""
    folder = Path(os.environ.get("UMC_DATA", str(ROOT.parent / "shared/data")))
    if not (folder / NAME).is_file():
        return [("carving", "skipped", f"{NAME} is not in {folder}; set UMC_DATA")]
    return [_row(folder / NAME, estimator) for estimator in EstimatorName]


def _row(bag: Path, estimator: EstimatorName) -> Row:
    options = map_bag_arguments([str(bag), "--out", "nowhere", "--set", f"estimator={estimator.value}"])
    recording = read_recording(bag, options.request)
    parameters = with_odometry(options.parameters, odometry_of(recording.track).kind, options.fixed)
    carving, plain = (
        parameters.changed({"carve": carve}).build_localiser(recording.sonar_in_base) for carve in (True, False)
    )
    scans = [scan for scan, _ in scans_of(recording, parameters.echoes())]
    seconds = np.array([(_cpu(carving, scan), _cpu(plain, scan)) for scan in scans])[_WARM_UP:]
    with_it, without = seconds.mean(axis=0)
    text = f"{100 * (1.0 - without / with_it):.0f} % of {1e3 * with_it:.0f} ms of a core"
    return f"carving, {estimator.value}, {len(scans)} scans of a marina", text, "< 20 %"


def _cpu(localiser: Localiser, scan: Scan) -> float:
    start = time.process_time()
    localiser.take_scan(scan)
    return time.process_time() - start
