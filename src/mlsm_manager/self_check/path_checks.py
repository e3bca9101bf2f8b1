"""Does the corrected path go as far as the odometry says, within what the odometry may err?

A matcher that is dragged along a featureless canal finds a path that is too short, and is sure of every step. The
odometry's scale is known far better than that.
"""

from typing import Sequence, Tuple

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_STEP = 14.0  # s between windows: about one turn of a head
_SHORTEST = 15.0  # m that the vehicle must have gone in a window, so that a ratio means something
_HEADING_SPREAD = 0.05  # rad by which the direction of motion may differ along a run: compass and mounting
_NOWHERE = np.empty((0, 2))


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


def settings_agree(times: np.ndarray, paths: np.ndarray, deviations: np.ndarray, limit: float = 2.0) -> Verdict:
    """Return how far paths of other settings or starts lie from the first one, in its told deviations.

    times: (m,) s. paths: (k, m, >= 2), the first is the one that is told. deviations: (m,) m, 2-D standard deviations.
    The value is the root mean square over the run of the farthest path.
    """
    distance = np.hypot(*np.moveaxis(paths[1:, :, :2] - paths[0, :, :2], 2, 0)) / deviations
    step = float(np.median(np.diff(times)))
    far = merged(times[(distance > limit).any(axis=0)], step)
    value = float(np.sqrt((distance**2).mean(axis=1)).max()) if len(distance) else np.nan
    question = "Does the path stay where it is when the solver's settings change a little?"
    return Verdict(
        "spread over settings", value, limit, "farthest path, told deviations", doubtful=far, question=question
    )


def starts_agree(
    times: np.ndarray, path: np.ndarray, other_start: np.ndarray, other_path: np.ndarray, limit: float = 0.5
) -> Verdict:
    """Return which share of the way from a path to another start is left between it and the path found from there.

    times: (m,) s. path, other_start, other_path: (m, >= 2). The value is the ratio of the root mean squares.
    """
    displaced, left = (np.hypot(*(one - path)[:, :2].T) for one in (other_start, other_path))
    ratio = float(np.sqrt((left**2).mean() / max((displaced**2).mean(), np.finfo(float).tiny)))
    far = merged(times[left > limit * displaced.max()], float(np.median(np.diff(times)))) if ratio > limit else _NOWHERE
    return Verdict(
        "second start", ratio, limit, "share of a start's displacement by a told deviation that is left",
        doubtful=far, question="Does the solver come back to the same path when it starts a told deviation beside it?",
    )  # fmt: skip


def told_deviation(times: np.ndarray, deviations: np.ndarray, limit: float = 5.0) -> Verdict:
    """Return the largest of the path's own 2-D deviations (m,) [m] at `times` (m,) [s]."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    doubtful = merged(times[deviations > limit], step)
    text, question = "largest along the path, m", "How far off may the position be, by the solver's own account?"
    return Verdict("told deviation", float(deviations.max()), limit, text, doubtful=doubtful, question=question)


def per_minute(times: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Return the mean of `deviations` (m,) in each minute from the first of `times` (m,) [s] on; NaN for a gap."""
    minutes = ((times - times[0]) // 60.0).astype(int)
    with np.errstate(invalid="ignore"):
        return np.bincount(minutes, deviations) / np.bincount(minutes)


def halves_agree(
    names: Sequence[str],
    first: np.ndarray,
    first_deviations: np.ndarray,
    second: np.ndarray,
    second_deviations: np.ndarray,
    limit: float = 3.0,
) -> Verdict:
    """Return by how many deviations the halves' calibrations (n,) differ at most; `names` (n,) are what they are."""
    spread = np.sqrt(np.asarray(first_deviations) ** 2 + np.asarray(second_deviations) ** 2)
    distances = np.abs(np.asarray(first) - np.asarray(second)) / spread
    worst = int(np.argmax(distances))
    text = f"halves differ most in {names[worst]}: {first[worst]:.4g} and {second[worst]:.4g}, deviations"
    question = "Do the first and the second half of the run find the same errors of sonar and odometry?"
    return Verdict("calibration of the halves", float(distances[worst]), limit, text, question=question)


def as_expected(
    names: Sequence[str],
    expected: np.ndarray,
    expected_deviations: np.ndarray,
    found: np.ndarray,
    limit: float = 3.0,
) -> Verdict:
    """Return by how many deviations what a run `found` (n,) is from what was `expected` (n,) before it, at most.

    `names` (n,) are what they are; n > 0.
    """
    expected, deviations, found = np.asarray(expected), np.asarray(expected_deviations), np.asarray(found)
    distances = np.abs(found - expected) / deviations
    worst = int(np.argmax(distances))
    before = f"{expected[worst]:.4g} +- {deviations[worst]:.4g} was expected"
    text = f"{names[worst]} is {found[worst]:.4g}, {before}, deviations"
    question = "Are the errors of sonar and odometry as large as those of such devices, mounted as described?"
    return Verdict("calibration as expected", float(distances[worst]), limit, text, question=question)
