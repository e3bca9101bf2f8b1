"""Trajectories in the format of the TUM RGB-D benchmark, which evo and others read (Sturm et al. 2012)."""

from typing import Dict, Mapping, Optional

import numpy as np

from mlsm_manager.offline.recording import Truth


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
