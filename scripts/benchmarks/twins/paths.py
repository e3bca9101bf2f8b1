"""True paths of twins, made from the path of a recording."""

import numpy as np

from benchmarks.twins.parameters import PathForm, TwinParameters
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import rotated

_STRAIGHT_ON = 0.45  # share of the run after which END_FIRST begins


def true_path(recorded: Track, parameters: TwinParameters) -> Track:
    """Return the twin's path at the recording's times; it begins at the origin."""
    poses = _FORMS[parameters.path](recorded.poses)
    poses = poses - np.array([*poses[0, :2], 0.0])
    positions = rotated(poses[:, :2], np.full(len(poses), parameters.rotation))
    return Track(recorded.times, np.column_stack([positions, poses[:, 2] + parameters.rotation]))


def _mirrored(poses: np.ndarray) -> np.ndarray:
    return poses * np.array([1.0, -1.0, -1.0])


def _reversed(poses: np.ndarray) -> np.ndarray:
    return poses[::-1]


def _end_first(poses: np.ndarray) -> np.ndarray:
    """Return the later part, then the earlier one moved to where the later one ended."""
    start = int(_STRAIGHT_ON * len(poses))
    later, earlier = poses[start:], poses[:start]
    return np.concatenate([later, earlier + (later[-1] - earlier[0])])


def _there_and_back(poses: np.ndarray) -> np.ndarray:
    """Return the first half of the path, and the same way home."""
    half = len(poses) // 2
    home = poses[:half][::-1]
    return np.concatenate([poses[:half], home, np.repeat(home[-1:], len(poses) - 2 * half, axis=0)])


_FORMS = {
    PathForm.AS_RECORDED: np.array,
    PathForm.MIRRORED: _mirrored,
    PathForm.REVERSED: _reversed,
    PathForm.END_FIRST: _end_first,
    PathForm.THERE_AND_BACK: _there_and_back,
}
