"""What map_bag leaves in its folder."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence

import numpy as np

from mlsm_manager.offline.evaluation import aligned_truth, position_error
from mlsm_manager.offline.picture_contents import Doubts, Path2d
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.trust import Trust
from mlsm_manager.offline.tum_files import tum_files
from mlsm_manager.report.mission import Path as Way
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import StoredMap, write_map
from mlsm_manager.surface_map.ply_file import write_ply
from node_support.files import write_whole
from node_support.geometry import wrapped

ODOMETRY = "dead_reckoning"
CORRECTED = "corrected"
REFINED = "refined"
REPORT = "report.html"
LABELS = {ODOMETRY: "dead reckoning", CORRECTED: "corrected", REFINED: "refined"}
COLORS = {ODOMETRY: "#999999", CORRECTED: "#1f5fa8", REFINED: "#118833"}
_COLUMNS = {ODOMETRY: "odometry", CORRECTED: "corrected", REFINED: "refined"}
TRUTH_COLOR = "#111111"
FURTHER_COLORS = ("#8833aa", "#cc6611", "#2299aa", "#996655", "#556b2f")
# More would hide the path.
_MOST_ELLIPSES = 40


@dataclass(frozen=True)
class Run:
    """times: (m,) s. poses: name -> (m, 3) x y yaw, the last one is the best. counts: what goes into the summary.
    stored: the final map. trust: what the checks say; None where there are none. further: ways of further recordings.
    """

    times: np.ndarray
    poses: Dict[str, np.ndarray]
    counts: Dict[str, Any]
    stored: StoredMap
    trust: Optional[Trust] = None
    further: Sequence[Way] = ()

    @property
    def blocks(self) -> Blocks:
        """The blocks of the final map."""
        return self.stored.shown


def write_run(folder: Path, name: str, run: Run, recording: Recording) -> None:
    """Write map.mlsm, map.ply, map.png, trajectory.csv and the .tum files, each whole or not at all; raises OSError."""
    # matplotlib takes half a second: who asks for help or is refused shall not wait for it.
    from mlsm_manager.offline.picture import draw_map

    write_map(folder / "map.mlsm", run.stored)
    write_ply(folder / "map.ply", run.blocks)
    write_trajectory(folder / "trajectory.csv", run.times, run.poses)
    for path, text in tum_files(run.times, run.poses, recording.truth).items():
        write_whole(folder / path, text.encode("ascii"))
    draw_map(folder / "map.png", name, run.blocks, [], _paths(run, recording), _doubts(run))


def write_summary(folder: Path, summary: Dict[str, Any]) -> None:
    """Write summary.json whole or not at all; raises OSError."""
    write_whole(folder / "summary.json", (json.dumps(summary, indent=2) + "\n").encode("ascii"))


def errors_of(run: Run, recording: Recording) -> Dict[str, Dict[str, float]]:
    """Return the error of every trajectory of the run; nothing without a truth. Raises RecordingError."""
    if recording.truth is None:
        return {}
    return {name: position_error(run.times, poses, recording.truth).to_mapping() for name, poses in run.poses.items()}


def write_trajectory(path: Path, times: np.ndarray, poses: Mapping[str, np.ndarray]) -> None:
    """Write trajectories (m, 3) at `times` (m,) s whole or not at all; raises OSError."""
    write_whole(path, trajectory_csv(times, poses).encode("ascii"))


def trajectory_csv(times: np.ndarray, poses: Mapping[str, np.ndarray]) -> str:
    """Return the table of trajectories (m, 3) at `times` (m,): time [s], then x y [m] and yaw [rad] of each."""
    header = ["time"] + [f"{_COLUMNS[name]}_{axis}" for name in poses for axis in ("x", "y", "yaw")]
    columns: List[np.ndarray] = [times[:, np.newaxis]]
    for path in poses.values():
        columns += [path[:, :2], wrapped(path[:, 2:])]
    rows = np.concatenate(columns, axis=1)
    line = ",".join(["%.6f"] + ["%.4f"] * (rows.shape[1] - 1)) + "\n"
    # All lines at once: that takes half the time of one after the other.
    return ",".join(header) + "\n" + line * len(rows) % tuple(rows.ravel().tolist())


def _doubts(run: Run) -> Optional[Doubts]:
    if run.trust is None:
        return None
    told = list(run.poses.values())[-1]
    deviations = run.trust.deviations
    shown = slice(None, None, max(1, len(deviations.times) // _MOST_ELLIPSES))
    centers = np.stack([np.interp(deviations.times, run.times, told[:, axis]) for axis in (0, 1)], axis=-1)
    stretches = [told[(run.times >= start) & (run.times <= end), :2] for start, end in run.trust.doubtful]
    return Doubts(centers[shown], deviations.covariances[shown], stretches)


def _paths(run: Run, recording: Recording) -> List[Path2d]:
    paths = [Path2d(poses[:, :2], LABELS[name], COLORS[name]) for name, poses in run.poses.items()]
    truth = _truth_path(run, recording)
    paths += [Path2d(way.poses[:, :2], way.name, way.color) for way in run.further]
    return paths if truth is None else [*paths, truth]


def _truth_path(run: Run, recording: Recording) -> Optional[Path2d]:
    if recording.truth is None:
        return None
    positions = aligned_truth(run.times, run.poses[ODOMETRY], recording.truth)
    return Path2d(positions, "truth", TRUTH_COLOR)
