"""Peaks, edges and runs of the rows of a polar image, and what they tell of echoes: their length along range."""

import math
from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from node_support.geometry import members

_AS_STRONG = 0.9  # of the strongest in a turn, in which a gain that fades changes little
_ONE_STRENGTH = 0.9  # share of the strengths above 0 that are as strong; real heads and a simulated one have up to 0.26
_QUANTILE = 0.4  # over the beams of a turn: what is heard in most directions at a range is no echo
_LEVEL = 0.75  # of the autocorrelation: high on its flank, where slanting walls lengthen the echoes least
_LEAST, _MOST = 0.15, 2.0  # m: a pulse of 0.2 ms, and a wall that a wide beam meets aslant
_FEWEST_BINS = 4
_SAME_LENGTH = 1e-3  # share by which the length of a bin may differ: places in float32 round it


class EchoStatistics:
    """Collects what tells shape and length of echoes, turn by turn; holds one number per bin."""

    def __init__(self, bins: int, range_resolution: float) -> None:
        """bins: of every beam. range_resolution: length of a bin, m."""
        self._resolution = range_resolution
        self._as_strong, self._heard = 0, 0
        self._correlation = np.zeros(bins)

    def has_bins(self, bins: int, range_resolution: float) -> bool:
        """Return whether beams with so many bins of this length [m] belong to the others, but for rounding."""
        return bins == len(self._correlation) and math.isclose(range_resolution, self._resolution, rel_tol=_SAME_LENGTH)

    def add(self, strengths: np.ndarray) -> None:
        """Take the beams of a turn: (beams, bins), any numeric type."""
        self._correlation += _autocorrelation(strengths.astype(np.float32))
        is_heard = strengths > 0
        self._heard += int(np.count_nonzero(is_heard))
        self._as_strong += int(np.count_nonzero(is_heard & (strengths >= _AS_STRONG * strengths.max(initial=0))))

    @property
    def are_plateaus(self) -> bool:
        """Whether nearly all echoes are as strong as any: strengths only say "something" or "nothing".

        Such an echo is metres long, its middle means nothing, and the surface is where it begins.
        """
        return self._heard > 0 and self._as_strong >= _ONE_STRENGTH * self._heard

    @property
    def sigma(self) -> float:
        """Standard deviation of an echo along range, between 0.15 and 2 m.

        The autocorrelation of a Gaussian echo of deviation s falls to `_LEVEL` at a shift of 2 s sqrt(-log(_LEVEL)).
        Its value at shift 0 is taken from shifts 1 and 2, because what differs from bin to bin at random counts there
        only.
        """
        correlation = self._correlation
        if correlation.size < _FEWEST_BINS or not correlation[1] > 0.0:
            return _LEAST
        top = (4.0 * correlation[1] - correlation[2]) / 3.0
        shift = self._resolution * _falls_below(correlation, _LEVEL * top)
        return float(np.clip(shift / (2.0 * np.sqrt(-np.log(_LEVEL))), _LEAST, _MOST))


def _autocorrelation(strengths: np.ndarray) -> np.ndarray:
    """Return (bins,) the autocorrelation along range of what stands out of the ring, summed over the beams."""
    beams, bins = strengths.shape
    rank = int(_QUANTILE * (beams - 1))
    heights = np.maximum(strengths - np.partition(strengths, rank, axis=0)[rank], 0.0)
    spectrum = np.fft.rfft(heights, 2 * bins, axis=1)
    return np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=0))[:bins]


def _falls_below(values: np.ndarray, level: float) -> float:
    """Return the place, linearly between the bins, at which values (n,) first fall below a level from bin 1 on."""
    below = np.flatnonzero(values[1:] < level)
    if not len(below):
        return float(len(values))
    before = int(below[0])
    share = (values[before] - level) / (values[before] - values[before + 1])
    return before + float(np.clip(share, 0.0, 1.0))


_LEVELS_PER_STRENGTH = 64.0  # Exact in float32 up to 2^18 strengths, and finer than speckle
_ROUNDING = 1e-3  # Bins: a quotient that is a whole number but for rounding counts as whole


@dataclass(frozen=True)
class Peaks:
    """Places in a polar image: beams (n,) int, bins (n,) float64 (bin i has its centre at i), heights (n,) float32."""

    beams: np.ndarray
    bins: np.ndarray
    heights: np.ndarray

    def __len__(self) -> int:
        return len(self.beams)

    def select(self, keep: np.ndarray) -> "Peaks":
        """Return those where `keep` (n,) holds."""
        return Peaks(self.beams[keep], self.bins[keep], self.heights[keep])


def find_peaks(image: np.ndarray, apart: int) -> Peaks:
    """Return the local maxima above zero of each row, none of them within `apart` bins of a higher one.

    image: (beams, bins) float32. Peaks are placed between the bins by a parabola, level ones in their middle. Levels
    closer than 1/64 count as equal, so that rounding makes no peaks on a saturated echo.
    """
    beams, first, last = _level_tops(image)
    middle = (first + last) // 2
    heights = image[beams, middle]
    highest_near = maximum_filter1d(image, 2 * apart + 1, axis=1, mode="constant")[beams, middle]
    keep = (heights > 0.0) & (heights >= highest_near - 1.0 / _LEVELS_PER_STRENGTH)
    beams, first, last, middle = beams[keep], first[keep], last[keep], middle[keep]
    bins = np.where(first == last, middle + _summit(image, beams, middle), (first + last) / 2.0)
    return Peaks(beams, bins, heights[keep])


def _level_tops(image: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return row, first and last bin of every stretch of equal bins that is higher than what lies beside it."""
    rows, columns = image.shape
    levels = np.full((rows, columns + 2), -1, dtype=np.int32)
    levels[:, 1:-1] = np.rint(image * _LEVELS_PER_STRENGTH)
    step = np.diff(levels.ravel())
    changes = np.flatnonzero(step)
    rises = step[changes] > 0
    tops = np.flatnonzero(rises[:-1] & ~rises[1:])
    beams, first = np.divmod(changes[tops] + 1, columns + 2)
    last = changes[tops + 1] - beams * (columns + 2)
    return beams, first - 1, last - 1


def _summit(image: np.ndarray, beams: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """Return where between -0.5 and 0.5 bins the parabola through a peak and its neighbours is highest.

    Beyond the first and the last bin nothing is heard.
    """
    end = image.shape[1] - 1
    top = image[beams, bins]
    left = np.where(bins > 0, image[beams, np.maximum(bins - 1, 0)], 0.0)
    right = np.where(bins < end, image[beams, np.minimum(bins + 1, end)], 0.0)
    bend = left - 2.0 * top + right
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = 0.5 * (left - right) / bend
    return np.where(bend < 0.0, np.clip(offset, -0.5, 0.5), 0.0)


def leading_edges(image: np.ndarray, peaks: Peaks) -> Peaks:
    """Return where each peak's echo rises through half of the peak's height; one place per echo, its highest peak.

    image: (beams, bins) float32, in which the peaks were found.
    """
    bins = np.rint(peaks.bins).astype(np.int64)
    half = peaks.heights / 2.0
    walking = np.arange(len(bins))
    while walking.size:
        before = np.maximum(bins[walking] - 1, 0)
        higher = (bins[walking] > 0) & (image[peaks.beams[walking], before] >= half[walking])
        walking = walking[higher]
        bins[walking] -= 1
    below = image[peaks.beams, np.maximum(bins - 1, 0)]
    above = image[peaks.beams, bins]
    with np.errstate(divide="ignore", invalid="ignore"):
        edges = np.where(bins > 0, bins - (above - half) / (above - below), 0.0)
    return _highest_of_each(replace(peaks, bins=edges), bins)


def _highest_of_each(peaks: Peaks, bins: np.ndarray) -> Peaks:
    order = np.lexsort([-peaks.heights, bins, peaks.beams])
    beams, bins = peaks.beams[order], bins[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(beams) != 0) | (np.diff(bins) != 0)
    return peaks.select(order[first])


def points_along_runs(image: np.ndarray, threshold: float, spacing: float) -> Peaks:
    """Return places `spacing` bins apart along every run of bins that reach `threshold`, the first at its beginning.

    A run of n bins gives ceil(n / spacing) places, centred on the bins they lie in.
    """
    padded = np.zeros((image.shape[0], image.shape[1] + 2), dtype=np.int8)
    padded[:, 1:-1] = image >= max(threshold, np.finfo(np.float32).tiny)
    change = np.diff(padded, axis=1)
    beams, starts = np.nonzero(change > 0)
    lengths = np.nonzero(change < 0)[1] - starts
    spacing = max(spacing, 1.0)
    counts = np.ceil(lengths / spacing - _ROUNDING).astype(np.int64)
    runs, within = members(counts)
    bins = starts[runs] + np.floor(within * spacing + _ROUNDING)
    beams = beams[runs]
    return Peaks(beams, bins, image[beams, bins.astype(np.int64)])
