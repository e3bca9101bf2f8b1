"""Causes that beams of a head that turns show by themselves: a blind side, and settings that changed in mid-run."""

from typing import List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.sonar_trials import SonarFault, SonarKind
from mlsm_manager.self_check.causes import Cause
from node_support.timing import stretches
from sonar_processing.beams.beam import Beam

_CERTAIN = 500.0  # nats: of what needs no comparison of scans to be seen
_MOSTLY = 0.5  # share of the beams that are like themselves at twice the range
_SECTORS, _BLIND = 36, 15  # of the circle; so many beside each other, 150 degrees, hear nothing while the others do
_HEARS, _DEAF = 0.3, 0.02  # shares of the beams of a sector that hear something
_SIDE = 60.0  # s before and after a change that are compared: some turns of the head
_PARTS = np.array([-1.0, -0.6, -0.2, 0.0, 0.2, 0.6, 1.0])  # of these: all parts of a side must say the same
_FEWEST = 10  # beams in a part
_CHANGED, _STEADY = 1.5, 1.15  # times: by more a setting changed, by less the parts of a side differ
_USUAL = [0.05, 0.95]  # shares of the beams that have shorter ranges: a few may be cut short
_SAMPLE = 400  # beams that tell whether echoes come twice
_RATIOS = np.array([2.0, 1.5, 1.6, 1.7, 1.8, 1.9, 2.1, 2.2, 2.3, 2.5])  # of ranges: twice, and others by chance
_NEAREST = 1.0 / 3.0  # of the range, from which on echoes are compared with those nearer


def of_trembling(degrees: float, is_mended: bool) -> Cause:
    """Return the cause for a head whose reported angles tremble; is_mended: whether they are those of its turn now."""
    return Cause(f"the head's angles tremble by {degrees:.0f} deg", _CERTAIN, is_mended=is_mended, metres=0.5)


def beam_causes(beams: Sequence[Beam]) -> List[Cause]:
    """Return what the beams of a recording, in the order of their stamps, show, while their head turns."""
    causes, heard = head_causes(beams), [beam for beam in beams if beam.intensities.any()]
    times = np.array([beam.stamp_ns * 1e-9 for beam in heard])
    stronger = _change(times, np.array([float(beam.intensities.max()) for beam in heard]))
    if stronger is not None:
        begin, ratio = stronger
        text = f"the gain changed: echoes are {ratio:.1f} times as strong from then on"
        causes.append(Cause(text, _CERTAIN / 10.0, begin, metres=1.0))
    longer = _change(times, np.array([_length(beam) for beam in heard]))
    if longer is not None:
        # Echoes that are longer than they were may be as long as ever, in reported ranges longer than the true ones.
        begin, ratio = longer
        text = f"gain, pulse length or range setting changed: echoes are {ratio:.1f} times as long from then on"
        fault = SonarFault(SonarKind.RANGES, begin, (-float(np.log(ratio)),))
        causes.append(Cause(text, _CERTAIN / 10.0, begin, metres=1.0, fault=fault))
    return causes


def head_causes(beams: Sequence[Beam]) -> List[Cause]:
    """Return what is wrong with the head or its window, as far as a few minutes of beams show it."""
    return [cause for cause in (_blind(beams), _doubled(beams)) if cause is not None]


def ranges_are_told(beams: Sequence[Beam]) -> bool:
    """Return whether messages tell that the range setting changed: then none changed untold."""
    ranges = [beam.range_resolution * len(beam.intensities) for beam in beams if len(beam.intensities)]
    shortest, longest = np.quantile(ranges, _USUAL) if ranges else (0.0, 0.0)
    return bool(longest > _CHANGED * shortest)


def _blind(beams: Sequence[Beam]) -> Optional[Cause]:
    """Return whether about half of the circle hears nothing, though the head looks there."""
    hears = np.array([bool(beam.intensities.any()) for beam in beams])
    angles = np.array([beam.angle for beam in beams])
    sector = ((angles % (2.0 * np.pi)) / (2.0 * np.pi) * _SECTORS).astype(int) % _SECTORS
    looked = np.bincount(sector, minlength=_SECTORS)
    if looked.min() < 10:
        return None
    share = np.bincount(sector, hears, minlength=_SECTORS) / looked
    longest = max((last - first for first, last in stretches(np.tile(share < _DEAF, 2))), default=0)
    if not _BLIND <= longest < _SECTORS or np.median(share[share >= _DEAF]) < _HEARS:
        return None
    degrees = 360.0 * longest / _SECTORS
    return Cause(f"the sonar hears nothing in {degrees:.0f} deg of its circle", _CERTAIN, metres=0.5)


def _doubled(beams: Sequence[Beam]) -> Optional[Cause]:
    """Return whether most beams are like themselves at twice the range, more than at any other ratio of ranges."""
    chosen = (beam.intensities.astype(float) for beam in beams[:: max(len(beams) // _SAMPLE, 1)])
    alike = np.array([_alike_at(strengths) for strengths in chosen]).reshape(-1, len(_RATIOS))
    alike = alike[np.isfinite(alike).all(axis=1)]
    if len(alike) < _FEWEST or np.mean(alike[:, 0] > alike[:, 1:].max(axis=1)) < _MOSTLY:
        return None
    return Cause("echoes come twice, from twice as far again, as by the surface or the hull", _CERTAIN, metres=1.0)


def _alike_at(strengths: np.ndarray) -> np.ndarray:
    """Return the correlations (k,) of the far part of a beam with its nearer parts, by the ratios of ranges."""
    bins = np.arange(int(_NEAREST * len(strengths)), len(strengths))
    nearer = strengths[(bins / _RATIOS[:, np.newaxis]).astype(int)]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.corrcoef(strengths[bins], nearer)[0, 1:]


def _length(beam: Beam) -> float:
    """Return how many bins are strong, m."""
    strengths = beam.intensities
    return float(np.count_nonzero(strengths > strengths.max() / 2)) * beam.range_resolution


def _change(times: np.ndarray, values: np.ndarray) -> Optional[Tuple[float, float]]:
    """Return when [s] the median of `values` (n,) stepped, where both sides are steady, and by which factor."""
    if len(times) < _FEWEST:
        return None
    found, largest = None, _CHANGED
    for moment in np.arange(times[0] + _SIDE, times[-1] - _SIDE, _SIDE / 12.0).tolist():
        edges = np.searchsorted(times, moment + _SIDE * _PARTS)
        parts = [values[first:last] for first, last in zip(edges[:-1], edges[1:])]
        if min(len(part) for part in parts) < _FEWEST:
            continue
        medians = np.maximum([float(np.median(part)) for part in parts], 1e-6).reshape(2, -1)
        before, after = np.exp(np.log(medians).mean(axis=1))
        steady = (medians.max(axis=1) / medians.min(axis=1)).max() < _STEADY
        factor = max(before / after, after / before)
        if steady and factor > largest:
            found, largest = (moment, after / before), factor
    return found
