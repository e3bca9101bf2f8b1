"""What the strengths of a sonar tell of its echoes: whether they have peaks, and how long they are along range."""

import math
from enum import Enum

import numpy as np

_ONE_STRENGTH = 0.9  # share of the strengths above 0 that equal the strongest
_QUANTILE = 0.4  # over the beams of a turn: what is heard in most directions at a range is no echo
_LEVEL = 0.75  # of the autocorrelation: high on its flank, where slanting walls lengthen the echoes least
_LEAST, _MOST = 0.15, 2.0  # m: a pulse of 0.2 ms, and a wall that a wide beam meets aslant
_FEWEST_BINS = 4
_SAME_LENGTH = 1e-3  # share by which the length of a bin may differ: places in float32 round it


class EchoShape(Enum):
    """What an echo looks like along a beam.

    PEAK: strengths differ; an echo has a peak, and noise has no sharp edge. PLATEAU: strengths only say "something" or
    "nothing"; an echo is metres long, its middle means nothing, and the surface is where it begins.
    """

    PEAK = "PEAK"
    PLATEAU = "PLATEAU"


class EchoStatistics:
    """Collects what tells shape and length of echoes, turn by turn; holds one number per bin."""

    def __init__(self, bins: int, range_resolution: float) -> None:
        """bins: of every beam. range_resolution: length of a bin, m."""
        self._resolution = range_resolution
        self._strongest, self._as_strong, self._heard = 0.0, 0, 0
        self._correlation = np.zeros(bins)

    def has_bins(self, bins: int, range_resolution: float) -> bool:
        """Return whether beams with so many bins of this length [m] belong to the others, but for rounding."""
        return bins == len(self._correlation) and math.isclose(range_resolution, self._resolution, rel_tol=_SAME_LENGTH)

    def add(self, strengths: np.ndarray) -> None:
        """Take the beams of a turn: (beams, bins), any numeric type."""
        self._count(strengths)
        self._correlation += _autocorrelation(strengths.astype(np.float32))

    def _count(self, strengths: np.ndarray) -> None:
        strongest = float(strengths.max(initial=0))
        if strongest > self._strongest:
            self._strongest, self._as_strong = strongest, 0
        self._heard += int(np.count_nonzero(strengths > 0))
        if self._strongest > 0.0:
            self._as_strong += int(np.count_nonzero(strengths == self._strongest))

    @property
    def shape(self) -> EchoShape:
        """PLATEAU where nearly all echoes are as strong as any, else PEAK."""
        is_plateau = self._heard > 0 and self._as_strong >= _ONE_STRENGTH * self._heard
        return EchoShape.PLATEAU if is_plateau else EchoShape.PEAK

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
    after = int(below[0]) + 1
    before = after - 1
    share = (values[before] - level) / (values[before] - values[after])
    return before + float(np.clip(share, 0.0, 1.0))
