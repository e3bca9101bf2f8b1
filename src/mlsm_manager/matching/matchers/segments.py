"""The thesis's own translations by segments (6.5.6, figures 6.6 to 6.8).

While the vehicle is still the error of all points is the same; while it moves the error grows along a line over time,
whose slope is the velocity that is missing.
"""

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np

# Two times always lie on a line, and show no error of it.
_FEWEST_TIMES = 3


@dataclass(frozen=True)
class SegmentFit:
    """translations: (n, 2) m for each point, in the order of time. slope: (2,) m/s of the last segment, 0 if still."""

    translations: np.ndarray
    slope: np.ndarray


def translate_segments(times: np.ndarray, moving: np.ndarray, errors: np.ndarray) -> SegmentFit:
    """Return the translations that segments of points need.

    times: (n,) s, increasing or equal. moving: (n,) bool; a segment is a run of equal values. errors: (n, 2) m from
    each point to its block. A still segment moves by its mean error (the centroids' difference); a moving one starts
    with the translation that the segment before it ended with and goes on along a line.
    """
    translations = np.zeros((len(times), 2))
    slope = np.zeros(2)
    last = np.zeros(2)
    for number, (first, end) in enumerate(_runs(moving)):
        part = slice(first, end)
        if not moving[first]:
            slope = np.zeros(2)
            translations[part] = errors[part].mean(axis=0)
        else:
            since = times[part] - (times[first - 1] if first else times[first])
            offset, slope = _line(since, errors[part], last if number else None)
            translations[part] = offset + since[:, np.newaxis] * slope
        last = translations[end - 1]
    return SegmentFit(translations, slope)


def _runs(moving: np.ndarray) -> List[Tuple[int, int]]:
    changes = np.flatnonzero(np.diff(moving.astype(np.int8))) + 1
    bounds = np.concatenate([[0], changes, [len(moving)]])
    return [(int(first), int(end)) for first, end in zip(bounds[:-1], bounds[1:]) if end > first]


def _line(since: np.ndarray, errors: np.ndarray, start: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return offset (2,) and slope (2,) by least squares; the line begins at `start` where that is known."""
    if np.unique(since).size < _FEWEST_TIMES:
        return errors.mean(axis=0), np.zeros(2)
    if start is not None:
        return start, since @ (errors - start) / (since @ since)
    centered = since - since.mean()
    slope = centered @ errors / (centered @ centered)
    return errors.mean(axis=0) - since.mean() * slope, slope
