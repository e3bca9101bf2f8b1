"""Recorded missions through map_bag: what it found, beside the truth, and pictures of it."""

import csv
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping

import numpy as np
from benchmarks.recorded import ROOT
from matplotlib.axes import Axes

from mlsm_manager.offline.evaluation import aligned_truth, positions_at
from mlsm_manager.offline.recording import Truth
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.files.map_file import read_map
from thesis_results.block_views import draw_from_above
from thesis_results.pictures import Pictures, new_figure, to_scale

TRUTH = "/ground_truth"
PATHS = {"odometry": "dead reckoning", "corrected": "corrected", "refined": "refined"}
"""Columns of trajectory.csv and what they are called."""
COLOURS = {"odometry": "#999999", "corrected": "#1f5fa8", "refined": "#118833"}
_SUMMARY = {"odometry": "dead_reckoning", "corrected": "corrected", "refined": "refined"}
_MINUTE = 60.0


@dataclass(frozen=True)
class Mission:
    """What map_bag left.

    times: (m,) s. paths: (m, 2) x y [m] by column of trajectory.csv. blocks: of the final map. summary: summary.json.
    """

    times: np.ndarray
    paths: Mapping[str, np.ndarray]
    truth: Truth
    blocks: Blocks
    summary: Mapping[str, Any]

    @property
    def truth_in_map(self) -> np.ndarray:
        """(t, 2) m, the truth from where the paths begin."""
        return aligned_truth(self.times, self.paths["odometry"], self.truth)

    def errors(self, name: str) -> np.ndarray:
        """Return the distance (t,) m of a path from the truth at the truth's stamps."""
        places = positions_at(self.times, self.paths[name], self.truth.times)
        return np.hypot(*(places - aligned_truth(self.times, self.paths[name], self.truth)).T)


def mapped(bag: Path, *options: str) -> Mission:
    """Return what `map_bag --refine` makes of a recording with a truth; raises CalledProcessError."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, str(ROOT / "nodes/map_bag"), str(bag), "--out", folder, "--truth", TRUTH, "--refine"]
        subprocess.run([*command, *options], check=True, stdout=subprocess.DEVNULL)
        return _read(Path(folder))


def _read(folder: Path) -> Mission:
    with (folder / "trajectory.csv").open() as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    paths = {name: np.column_stack([columns[f"{name}_x"], columns[f"{name}_y"]]) for name in PATHS}
    truth = np.loadtxt(str(folder / "truth.tum"))
    return Mission(
        columns["time"], paths, Truth(truth[:, 0], truth[:, 1:3]), read_map(folder / "map.mlsm").shown,
        json.loads((folder / "summary.json").read_text()),
    )  # fmt: skip


def error_rows(mission: Mission) -> List[List[str]]:
    """Return rows of path, mean, standard deviation and maximum of the distance from the truth."""
    errors: Dict[str, Dict[str, float]] = {PATHS[name]: mission.summary[key] for name, key in _SUMMARY.items()}
    return [[name, *(f"{error[kind]:.2f} m" for kind in ("mean", "sd", "max"))] for name, error in errors.items()]


def draw_map(pictures: Pictures, name: str, mission: Mission, what: str) -> str:
    """Save the map with all paths and return its Markdown."""
    figure, ((axes,),) = new_figure(11.0, 7.0)
    draw_from_above(axes, mission.blocks, alpha=0.6)
    for path, places in mission.paths.items():
        axes.plot(*places.T, color=COLOURS[path], linewidth=1.5, label=PATHS[path])
    axes.plot(*mission.truth_in_map.T, color="k", linewidth=1.0, linestyle="--", label="truth")
    to_scale(axes, "")
    axes.legend()
    return pictures.save(name, figure, what)


def draw_errors(pictures: Pictures, name: str, mission: Mission, what: str) -> str:
    """Save the errors over time with the deviation that was told and return the Markdown."""
    figure, ((axes,),) = new_figure(11.0, 4.0)
    minutes = (mission.truth.times - mission.times[0]) / _MINUTE
    _draw_told(axes, mission)
    for path in mission.paths:
        axes.plot(minutes, mission.errors(path), color=COLOURS[path], label=PATHS[path])
    axes.set(xlabel="time, min", ylabel="distance from the truth, m")
    axes.set_ylim(bottom=0.0)
    axes.grid(True, linewidth=0.4)
    axes.legend()
    return pictures.save(name, figure, what)


def _draw_told(axes: Axes, mission: Mission) -> None:
    told = np.array(mission.summary["deviation_per_minute"], dtype=np.float64)
    axes.step(
        np.arange(len(told) + 1), np.append(told, told[-1:]), where="post", color="#c2185b", linewidth=1.0,
        label="standard deviation that map_bag tells",
    )  # fmt: skip


def trust_line(mission: Mission) -> str:
    """Return what map_bag says of the run itself, without the truth."""
    return f"`map_bag` says of itself: `{mission.summary['trust']}`."
