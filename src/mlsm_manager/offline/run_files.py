"""What map_bag leaves in its folder."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence

import numpy as np

from mlsm_manager.offline.findings import Trust
from mlsm_manager.offline.recording import Recording, Truth
from mlsm_manager.report.mission import Path as Trajectory
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import StoredMap, write_map
from mlsm_manager.surface_map.ply_file import write_ply
from node_support.files import write_whole
from node_support.geometry import wrapped
from recordings.bags.bag import RecordingError

ODOMETRY = "dead_reckoning"
CORRECTED = "corrected"
REFINED = "refined"
REPORT = "report.html"
LABELS = {ODOMETRY: "dead reckoning", CORRECTED: "corrected", REFINED: "refined"}
COLORS = {ODOMETRY: "#999999", CORRECTED: "#1f5fa8", REFINED: "#118833"}
_COLUMNS = {ODOMETRY: "odometry", CORRECTED: "corrected", REFINED: "refined"}
TRUTH_COLOR = "#111111"
FURTHER_COLORS = ("#8833aa", "#cc6611", "#2299aa", "#996655", "#556b2f")


@dataclass(frozen=True)
class Run:
    """times: (m,) s. poses: name -> (m, 3) x y yaw, the last one is the best. counts: what goes into the summary.
    stored: the final map. trust: what the checks say; None where there are none. further: trajectories of further
    recordings.
    """

    times: np.ndarray
    poses: Dict[str, np.ndarray]
    counts: Dict[str, Any]
    stored: StoredMap
    trust: Optional[Trust] = None
    further: Sequence[Trajectory] = ()

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
    known, uncertainty = trajectories_of(run, recording), None if run.trust is None else run.trust.uncertainty
    draw_map(folder / "map.png", name, run.blocks, [], [*known, *run.further], known[-1], uncertainty)


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


def trajectories_of(run: Run, recording: Recording) -> List[Trajectory]:
    """Return those of the run with names and colors: the odometry first, then the truth if known, the best one last."""
    found = [Trajectory(LABELS[name], COLORS[name], run.times, poses) for name, poses in run.poses.items()]
    if recording.truth is not None:
        positions = aligned_truth(run.times, run.poses[ODOMETRY], recording.truth)
        found.insert(1, Trajectory("truth", TRUTH_COLOR, recording.truth.times, positions))
    return found


def tum_files(times: np.ndarray, poses: Mapping[str, np.ndarray], truth: Optional[Truth]) -> Dict[str, str]:
    """Return names and texts of the files: one for each of `poses`, (m, 3) at `times` (m,) s, and one for the truth.

    The truth has no heading, its quaternions are those of heading 0.
    """
    files = {f"{name}.tum": tum_text(times, path) for name, path in poses.items()}
    if truth is not None:
        level = np.column_stack([truth.positions, np.zeros(len(truth.times))])
        files["truth.tum"] = tum_text(truth.times, level)
    return files


def tum_text(times: np.ndarray, poses: np.ndarray) -> str:
    """Return one line for each pose (m, 3), x y [m] and yaw [rad]: time, x y z, quaternion x y z w."""
    half = poses[:, 2] / 2.0
    rows = np.column_stack([times, poses[:, :2], np.sin(half), np.cos(half)])
    # All lines at once: that takes half the time of one after the other.
    return "%.9f %.6f %.6f 0 0 0 %.9f %.9f\n" * len(rows) % tuple(rows.ravel().tolist())


@dataclass(frozen=True)
class PositionError:
    """Horizontal distance from the truth at the truth's stamps, m."""

    mean: float
    sd: float
    max: float

    def to_mapping(self) -> Dict[str, float]:
        """Return plain values, rounded to a millimetre."""
        return {name: round(value, 3) for name, value in asdict(self).items()}


def position_error(times: np.ndarray, positions: np.ndarray, truth: Truth) -> PositionError:
    """Return the error of a trajectory: positions (m, >= 2) x y [m] at increasing times (m,) s.

    Only stamps of the truth that the trajectory covers count; the two are aligned by a translation that lets them
    begin at the same place, and not turned. Raises RecordingError when they have no time in common.
    """
    common = (truth.times >= times[0]) & (truth.times <= times[-1])
    if not common.any():
        raise RecordingError(
            f"truth from {truth.times[0]:.1f} to {truth.times[-1]:.1f} s, odometry from {times[0]:.1f} to "
            f"{times[-1]:.1f} s: no time in common"
        )
    shifted = aligned_truth(times, positions, truth)[common]
    distance = np.hypot(*(positions_at(times, positions, truth.times[common]) - shifted).T)
    return PositionError(float(distance.mean()), float(distance.std()), float(distance.max()))


def aligned_truth(times: np.ndarray, positions: np.ndarray, truth: Truth) -> np.ndarray:
    """Return the truth's positions (t, 2), shifted to begin where the trajectory was at the first common stamp."""
    first = int(np.searchsorted(truth.times, times[0]))
    first = min(first, len(truth.times) - 1)
    return truth.positions - truth.positions[first] + positions_at(times, positions, truth.times[first : first + 1])


def positions_at(times: np.ndarray, positions: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return x y (k, 2) at `wanted` (k,) s, linearly between the known ones."""
    return np.column_stack([np.interp(wanted, times, positions[:, axis]) for axis in range(2)])
