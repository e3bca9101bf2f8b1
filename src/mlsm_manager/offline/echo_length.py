"""How long the echoes of a recording are along range, from the strengths alone."""

from collections import Counter
from typing import Sequence

import numpy as np

from sonar_processing.beams.beam import Beam

_MOST_BEAMS = 2000  # about ten turns of a head, spread over the recording
_QUANTILE = 0.4  # over the beams: what is heard in most directions at a range is no echo
_LEVEL = 0.75  # of the autocorrelation: high on its flank, where slanting walls lengthen the echoes least
_RANGE = (0.15, 2.0)  # m: a pulse of 0.2 ms, and a wall that a wide beam meets aslant
_FEWEST_BINS = 4


def echo_sigma(beams: Sequence[Beam]) -> float:
    """Return the standard deviation [m] of an echo along range, between 0.15 and 2 m.

    The autocorrelation of a Gaussian echo of deviation s falls to `_LEVEL` at a shift of 2 s sqrt(-log(_LEVEL)). Its
    value at shift 0 is taken from shifts 1 and 2, because what differs from bin to bin at random counts there only.
    """
    (bins, resolution), _ = Counter((beam.intensities.size, beam.range_resolution) for beam in beams).most_common(1)[0]
    alike = [beam.intensities for beam in beams if (beam.intensities.size, beam.range_resolution) == (bins, resolution)]
    if bins < _FEWEST_BINS:
        return _RANGE[0]
    correlation = _autocorrelation(np.stack(alike[:: -(-len(alike) // _MOST_BEAMS)]).astype(np.float32))
    if not correlation[1] > 0.0:
        return _RANGE[0]
    top = (4.0 * correlation[1] - correlation[2]) / 3.0
    shift = resolution * _falls_below(correlation, _LEVEL * top)
    return float(np.clip(shift / (2.0 * np.sqrt(-np.log(_LEVEL))), *_RANGE))


def _autocorrelation(strengths: np.ndarray) -> np.ndarray:
    """Return (bins,) the autocorrelation along range of what stands out of the ring, summed over the beams."""
    heights = np.maximum(strengths - np.quantile(strengths, _QUANTILE, axis=0), 0.0)
    bins = heights.shape[1]
    spectrum = np.fft.rfft(heights, 2 * bins, axis=1)
    return np.fft.irfft((np.abs(spectrum) ** 2).mean(axis=0))[:bins]


def _falls_below(values: np.ndarray, level: float) -> float:
    """Return the place, linearly between the bins, at which values (n,) first fall below a level from bin 1 on."""
    below = np.flatnonzero(values[1:] < level)
    if not len(below):
        return float(len(values))
    after = int(below[0]) + 1
    before = after - 1
    share = (values[before] - level) / (values[before] - values[after])
    return before + float(np.clip(share, 0.0, 1.0))
