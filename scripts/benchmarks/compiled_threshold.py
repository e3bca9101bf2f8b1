"""Our threshold against plain C++ on the same points."""

import shutil
import subprocess
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Callable, Dict, List

import numpy as np

from benchmarks.in_turn import kernels, ratio_figure
from benchmarks.table import Row, median_seconds
from node_support.kernels import Kernel
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.strengths import StrengthLoops, strength_loops
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
    """Compare Otsu's threshold alone, and with the removal of what is weaker."""
    if shutil.which("g++") is None:
        return [("threshold by C++", "not measured: no g++", "")]
    points = turn_of_strengths()
    cloud = IntensityCloud(points, np.ones(POINTS), 10**9, "odom")
    stages = {kernel: Thresholder(ThresholderParameters(kernel=kernel)) for kernel in kernels()}
    loops = {kernel: strength_loops(kernel) for kernel in stages}
    left = {len(thresholder(cloud)) for thresholder in stages.values()}
    ours: Dict[Kernel, List[List[float]]] = {kernel: [] for kernel in stages}
    theirs = []
    with tempfile.TemporaryDirectory() as folder:
        program, data = Path(folder) / "threshold", Path(folder) / "points"
        subprocess.run(["g++", "-O2", "-o", str(program), str(SOURCE)], check=True)
        points.tofile(str(data))
        for _ in range(ROUNDS):
            for kernel, stage in stages.items():
                otsu = partial(_otsu, loops[kernel], cloud)
                ours[kernel].append([_seconds(otsu), _seconds(lambda s=stage: s(cloud))])
            *seconds, count = map(float, subprocess.check_output([str(program), str(data)]).split())
            if left != {count}:
                raise RuntimeError(f"C++ leaves {count:.0f} points, ours {left}")
            theirs.append(seconds)
    return [
        _row(f"{name} ({kernel.value})", np.array(ours[kernel])[:, column], np.array(theirs)[:, column])
        for column, name in enumerate(("Otsu's threshold", "threshold"))
        for kernel in stages
    ]


def _otsu(loops: StrengthLoops, cloud: IntensityCloud) -> float:
    return loops.separate(loops.count(cloud).levels)


def _seconds(call: Callable[[], object]) -> float:
    return median_seconds(call, REPEATS, time.process_time)


def _row(name: str, ours: np.ndarray, theirs: np.ndarray) -> Row:
    figure, verdict = ratio_figure(theirs / ours)
    return (
        f"{name}, {POINTS:,} points: plain C++ over ours of {1e3 * float(np.median(ours)):.2f} ms of CPU",
        figure,
        verdict,
    )
