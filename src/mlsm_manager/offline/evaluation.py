"""How far a trajectory is from the truth."""

from dataclasses import asdict, dataclass
from typing import Dict

import numpy as np

from mlsm_manager.offline.recording import Truth
from recordings.bags.bag import RecordingError


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
