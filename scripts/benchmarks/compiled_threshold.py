"""Our threshold against plain C++ on the same points."""

import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import List

import numpy as np

from benchmarks.in_turn import ratio_figure
from benchmarks.table import Row, median_seconds
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters

POINTS = 60_000
ROUNDS, REPEATS = 7, 50
SOURCE = Path(__file__).with_name("threshold.cpp")


def turn_of_strengths() -> np.ndarray:
    """Return (POINTS, 4) float32: a turn of speckle, of which about a sixth is above the threshold."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-50.0, 50.0, (POINTS, 4))
    points[:, 3] = np.minimum(np.floor(rng.gamma(1.0, 12.0, POINTS)), 255.0)
    return points.astype(np.float32)


def rows() -> List[Row]:
    """Compare the threshold."""
    if shutil.which("g++") is None:
        return [("threshold by C++", "not measured: no g++", "")]
    points = turn_of_strengths()
    cloud = IntensityCloud(points, np.ones(POINTS), 10**9, "odom")
    thresholder, ours, theirs = Thresholder(ThresholderParameters()), [], []
    left = len(thresholder(cloud))
    with tempfile.TemporaryDirectory() as folder:
        program, data = Path(folder) / "threshold", Path(folder) / "points"
        subprocess.run(["g++", "-O2", "-o", str(program), str(SOURCE)], check=True)
        points.tofile(str(data))
        for _ in range(ROUNDS):
            ours.append(median_seconds(lambda: thresholder(cloud), REPEATS, time.process_time))
            *_, seconds, count = map(float, subprocess.check_output([str(program), str(data)]).split())
            if left != count:
                raise RuntimeError(f"C++ leaves {count:.0f} points, ours {left}")
            theirs.append(seconds)
    what = f"threshold, {POINTS:,} points: plain C++ over ours of {1e3 * float(np.median(ours)):.2f} ms of CPU"
    return [(what, *ratio_figure(np.array(theirs) / np.array(ours)))]
