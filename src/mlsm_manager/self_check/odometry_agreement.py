"""Does the corrected path go as far as the odometry says, within what the odometry may err?

A matcher that is dragged along a featureless canal finds a path that is too short, and is sure of every step. The
odometry's scale is known far better than that.
"""

from typing import Tuple

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_STEP = 14.0  # s between windows: about one turn of a head
_SHORTEST = 15.0  # m that the vehicle must have gone in a window, so that a ratio means something
_HEADING_SPREAD = 0.05  # rad by which the direction of motion may differ along a run: compass and mounting


def against_odometry(
    times: np.ndarray,
    odometry: np.ndarray,
    corrected: np.ndarray,
    window: float = 350.0,
    scale_deviation: float = 0.01,
    position_walk: float = 0.12,
    limit: float = 4.0,
) -> Tuple[Verdict, Verdict]:
    """Return verdicts on the distances along and across the odometry's, in standard deviations.

    times: (m,) s. odometry, corrected: (m, >= 2) positions. window: s, about 25 scans. scale_deviation and
    position_walk [m/sqrt(s)]: of the odometry.
    """
    starts, by_odometry, ratio = _ratios(times, odometry, corrected, window)
    walk = position_walk**2 * window / np.abs(by_odometry) ** 2
    along = (np.abs(ratio) - 1.0) / np.sqrt(scale_deviation**2 + walk)
    direction = np.angle(ratio * np.exp(-1j * np.median(np.angle(ratio)))) if len(ratio) else np.empty(0)
    across = direction / np.sqrt(_HEADING_SPREAD**2 + walk)
    return (
        Verdict(
            "distance against odometry", _worst(along), limit, "longest or shortest stretch, deviations",
            doubtful=_doubtful(along, starts, window, limit),
            question="Is the corrected path as long as the odometry says, within what the odometry may err?",
        ),
        Verdict(
            "direction against odometry", _worst(across), limit, "most turned stretch, deviations",
            doubtful=_doubtful(across, starts, window, limit),
            question="Does the corrected path turn as the odometry does, all along the run?",
        ),
    )  # fmt: skip


def _ratios(
    times: np.ndarray, odometry: np.ndarray, corrected: np.ndarray, window: float
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of windows (n,) in which the vehicle goes far enough: starts [s], moves by the odometry as complex
    numbers [m], and the corrected moves over these.
    """
    starts = np.arange(times[0], times[-1] - window, _STEP)
    by_odometry, by_map = (_moves(times, path, starts, window) for path in (odometry, corrected))
    far = np.abs(by_odometry) > _SHORTEST
    return starts[far], by_odometry[far], by_map[far] / by_odometry[far]


def _moves(times: np.ndarray, path: np.ndarray, starts: np.ndarray, window: float) -> np.ndarray:
    """Return moves (n,) as complex numbers [m] in windows from `starts` on."""
    x, y = (
        np.interp(starts + window, times, path[:, axis]) - np.interp(starts, times, path[:, axis]) for axis in (0, 1)
    )
    return x + 1j * y


def _worst(deviations: np.ndarray) -> float:
    return float(np.abs(deviations).max()) if len(deviations) else np.nan


def _doubtful(deviations: np.ndarray, starts: np.ndarray, window: float, limit: float) -> np.ndarray:
    return merged(starts[np.abs(deviations) > limit], window)
