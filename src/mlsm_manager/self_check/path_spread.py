"""Does the path hang on settings, or on where the solution started, more than its told deviations allow?"""

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_NOWHERE = np.empty((0, 2))


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
