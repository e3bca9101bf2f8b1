"""How much of a scan's time carving takes in a real run; no truth is read."""

from typing import List

import numpy as np

from benchmarks.harness import MARINA, Row, cpu_seconds, missing_row, recorded
from mlsm_manager.localisation.parameters import EstimatorName
from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.recording import read_recording, scans_of
from mlsm_manager.offline.suited_parameters import odometry_of, with_odometry
from sonar_processing.filters.echo_extractor import EchoExtractor

_WARM_UP = 10
"""Scans until there is a map to be matched with and free space to be known."""


def rows() -> List[Row]:
    """Return the share of a scan's time that carving takes, with each estimator."""
    if not recorded(MARINA).is_file():
        return [missing_row(MARINA)]
    return [_carving_row(estimator) for estimator in EstimatorName]


def _carving_row(estimator: EstimatorName) -> Row:
    options = map_bag_arguments([str(recorded(MARINA)), "--out", "nowhere", "--set", f"estimator={estimator.value}"])
    recording = read_recording(recorded(MARINA), options.request)
    parameters = with_odometry(options.parameters, odometry_of(recording).kind, options.fixed)
    carving, plain = (
        parameters.changed({"carve": carve}).build_localiser(recording.sonar_in_base) for carve in (True, False)
    )
    scans = [scan for scan, _ in scans_of(recording, EchoExtractor(parameters.echoes()))]
    seconds = [[cpu_seconds(lambda m=m, s=scan: m.take_scan(s)) for m in (carving, plain)] for scan in scans]
    with_it, without = np.mean(seconds[_WARM_UP:], axis=0)
    text = f"{100 * (1.0 - without / with_it):.0f} % of {1e3 * with_it:.0f} ms of a core"
    return f"carving, {estimator.value}, {len(scans)} scans of a marina", text, "< 20 %"
