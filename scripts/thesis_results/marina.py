"""7.4: a real marina (Ribas et al. 2008), with its odometry and with its compass alone."""

import csv
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, List, Mapping

import numpy as np
from benchmarks.harness import ROOT, recorded, run_node
from matplotlib.axes import Axes

from mlsm_manager.offline.recording import Truth
from mlsm_manager.offline.run_files import aligned_truth, positions_at
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import read_map
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures, draw_from_above, new_figure, to_scale

RECORDING = "marina_first.bag"
RECORDINGS = (RECORDING,)
PATHS = {"odometry": "dead reckoning", "corrected": "corrected", "refined": "refined"}
"""Columns of trajectory.csv and what they are called; summary.json calls them so too, with underscores."""
COLOURS = {"odometry": "#999999", "corrected": "#1f5fa8", "refined": "#118833"}
_MINUTE = 60.0


def make(pictures: Pictures) -> str:
    """Return the section of the run with all of its odometry."""
    mission = mapped(recorded(RECORDING))
    return joined(
        prose("""The abandoned marina of St Pere Pescador (Ribas et al. 2008): the first twenty minutes of a run of
        a real vehicle that never stops, with a Micron sonar, a DVL and a compass. The thesis had no such recording.
        `map_bag --refine` mapped it; the DGPS on a buoy, which it never sees, is the truth."""),
        draw_map(
            pictures, "marina_map", mission,
            """Map and paths. Corrected: what the vehicle would have known at each moment. Refined: the whole run
            fitted afterwards. Dashed: DGPS.""",
        ),
        draw_errors(
            pictures, "marina_errors", mission,
            "Distance from DGPS over time, beside the standard deviation of the position that `map_bag` tells.",
        ),
        *_figures(mission),
    )  # fmt: skip


def make_compass_alone(pictures: Pictures) -> str:
    """Return the section of the run with nothing but the heading of its odometry."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "heading_only.bag"
        subprocess.run(
            [sys.executable, str(ROOT / "scripts/heading_only.py"), str(recorded(RECORDING)), str(bag)], check=True
        )
        mission = mapped(bag, "--odometry", "heading")
    return joined(
        prose("""The same run as a vehicle without a DVL would have recorded it: `scripts/heading_only` removes all
        of the odometry but its heading, and `map_bag --odometry heading` estimates the velocity from the scans."""),
        draw_map(pictures, "marina_heading_map", mission, "Map and paths with the compass alone. Dashed: DGPS."),
        draw_errors(pictures, "marina_heading_errors", mission, "Distance from DGPS over time with the compass alone."),
        *_figures(mission),
    )


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
        run_node("map_bag", bag, "--out", folder, "--truth", "/ground_truth", "--refine", *options)
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


def _figures(mission: Mission) -> List[str]:
    """Return distances from the truth, what the run found of sonar and odometry, and what map_bag says of itself."""
    errors = {name: mission.summary[name.replace(" ", "_")] for name in PATHS.values()}
    rows = [[name, *(f"{error[kind]:.2f} m" for kind in ("mean", "sd", "max"))] for name, error in errors.items()]
    calibration = ", ".join(
        f"`{name}` {one['value']:.3f} ± {one['deviation']:.3f}" for name, one in mission.summary["calibration"].items()
    )
    return [
        table(["distance from DGPS", "mean", "sd", "max"], rows),
        f"What the run found of sonar and odometry: {calibration}.",
        f"`map_bag` says of itself: `{mission.summary['trust']}`.",
    ]
