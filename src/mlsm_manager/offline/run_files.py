"""What map_bag leaves in its folder."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence

import numpy as np

from georeferencing.origin import Origin
from mlsm_manager.offline.recording import Recording, Truth
from mlsm_manager.offline.replay import CORRECTED, ODOMETRY
from mlsm_manager.offline.trust import Trust
from mlsm_manager.report.mission import Path as Trajectory
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.formats import write_ply
from mlsm_manager.surface_map.map_file import StoredMap, write_map
from node_support.files import write_whole
from node_support.geometry import wrapped
from recordings.bags.bag import RecordingError

REFINED = "refined"
REPORT = "report.html"
PICTURE = "map.png"
MCAP = "map.mcap"
_COLORS = {ODOMETRY: "#999999", CORRECTED: "#1f5fa8", REFINED: "#118833", "truth": "#111111"}
_COLUMNS = {ODOMETRY: "odometry", CORRECTED: "corrected", REFINED: "refined"}
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
    def best(self) -> np.ndarray:
        """(m, 3) x y yaw of the trajectory that counts."""
        return list(self.poses.values())[-1]

    @property
    def blocks(self) -> Blocks:
        return self.stored.shown


def write_run(folder: Path, name: str, run: Run, recording: Recording) -> None:
    """Write map.mlsm, map.ply, map.png, trajectory.csv and the .tum files, each whole or not at all; raises OSError."""
    # matplotlib takes half a second: who asks for help or is refused shall not wait for it.
    from mlsm_manager.offline.picture import draw_map

    write_map(folder / "map.mlsm", run.stored)
    write_ply(folder / "map.ply", run.blocks)
    write_trajectory(folder / "trajectory.csv", run.times, run.poses, run.stored.origin)
    for tum, poses in run.poses.items():
        _write_tum(folder / f"{tum}.tum", run.times, poses)
    if len(recording.soundings):
        _write_soundings(folder / "soundings.csv", run, recording.soundings)
    if recording.truth is not None:
        # The truth has no heading: its quaternions are those of heading 0.
        level = np.pad(recording.truth.positions, ((0, 0), (0, 1)), mode="constant")
        _write_tum(folder / "truth.tum", recording.truth.times, level)
    known, uncertainty = trajectories_of(run, recording), None if run.trust is None else run.trust.uncertainty
    paths = [*known, *run.further]
    draw_map(folder / PICTURE, name, run.blocks, paths, known[-1], uncertainty, run.stored.origin)


def write_summary(folder: Path, summary: Dict[str, Any]) -> None:
    """Write summary.json whole or not at all; raises OSError."""
    write_whole(folder / "summary.json", (json.dumps(summary, indent=2) + "\n").encode("ascii"))


def errors_of(run: Run, recording: Recording) -> Dict[str, Dict[str, float]]:
    """Return the error of every trajectory of the run; nothing without a truth. Raises RecordingError."""
    if recording.truth is None:
        return {}
    return {name: position_error(run.times, poses, recording.truth) for name, poses in run.poses.items()}


def write_trajectory(
    path: Path, times: np.ndarray, poses: Mapping[str, np.ndarray], origin: Optional[Origin] = None
) -> None:
    """Write the table of trajectories (m, 3) at `times` (m,): time [s], then x y [m] and yaw [rad] of each.

    With an origin latitude and longitude [deg] of the last one follow. It is written whole or not at all; raises
    OSError.
    """
    header = ["time"] + [f"{_COLUMNS[name]}_{axis}" for name in poses for axis in ("x", "y", "yaw")]
    columns: List[np.ndarray] = [times[:, np.newaxis]]
    for own in poses.values():
        columns += [own[:, :2], wrapped(own[:, 2:])]
    kinds = ["%.6f"] + ["%.4f"] * (len(header) - 1)
    if origin is not None:
        header, kinds = [*header, "latitude", "longitude"], [*kinds, "%.8f", "%.8f"]
        columns.append(origin.degrees(own))
    rows = np.concatenate(columns, axis=1)
    line = ",".join(kinds) + "\n"
    # All lines at once: that takes half the time of one after the other.
    text = ",".join(header) + "\n" + line * len(rows) % tuple(rows.ravel().tolist())
    write_whole(path, text.encode("ascii"))


def trajectories_of(run: Run, recording: Recording) -> List[Trajectory]:
    """Return those of the run with names and colors: the odometry first, then the truth if known, the best one last."""
    found = [Trajectory(name.replace("_", " "), _COLORS[name], run.times, poses) for name, poses in run.poses.items()]
    if recording.truth is not None:
        positions = aligned_truth(run.times, run.poses[ODOMETRY], recording.truth)
        found.insert(1, Trajectory("truth", _COLORS["truth"], recording.truth.times, positions))
    return found


def _write_soundings(path: Path, run: Run, soundings: np.ndarray) -> None:
    """Write where the vehicle was when an echo sounder told distances below: time [s], x y [m], below [m]."""
    rows = np.column_stack([soundings[:, 0], positions_at(run.times, run.best, soundings[:, 0]), soundings[:, 1]])
    lines = [f"{time:.3f},{x:.3f},{y:.3f},{below:.3f}\n" for time, x, y, below in rows.tolist()]
    write_whole(path, "".join(["time,x,y,below\n", *lines]).encode("ascii"))


def _write_tum(path: Path, times: np.ndarray, poses: np.ndarray) -> None:
    """Write one line for each pose (m, 3), x y [m] and yaw [rad]: time, x y z, quaternion x y z w."""
    half = poses[:, 2] / 2.0
    rows = np.column_stack([times, poses[:, :2], np.sin(half), np.cos(half)])
    # All lines at once: that takes half the time of one after the other.
    text = "%.9f %.6f %.6f 0 0 0 %.9f %.9f\n" * len(rows) % tuple(rows.ravel().tolist())
    write_whole(path, text.encode("ascii"))


def position_error(times: np.ndarray, positions: np.ndarray, truth: Truth) -> Dict[str, float]:
    """Return "mean", "sd" and "max" of a trajectory's horizontal distance [m] from the truth, to a millimetre.

    positions: (m, >= 2) x y [m] at increasing times (m,) s.

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
    figures = {"mean": distance.mean(), "sd": distance.std(), "max": distance.max()}
    return {name: round(float(value), 3) for name, value in figures.items()}


def aligned_truth(times: np.ndarray, positions: np.ndarray, truth: Truth) -> np.ndarray:
    """Return the truth's positions (t, 2), shifted to begin where the trajectory was at the first common stamp."""
    first = min(int(np.searchsorted(truth.times, times[0])), len(truth.times) - 1)
    return truth.positions - truth.positions[first] + positions_at(times, positions, truth.times[first : first + 1])


def positions_at(times: np.ndarray, positions: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return x y (k, 2) at `wanted` (k,) s, linearly between the known ones."""
    return np.column_stack([np.interp(wanted, times, positions[:, axis]) for axis in range(2)])
