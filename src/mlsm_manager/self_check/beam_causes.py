"""Causes that beams show by themselves: a head that stood, a blind side, and settings that changed in mid-run."""

from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.sonar_trials import SonarFault, SonarKind
from mlsm_manager.self_check.causes import CERTAIN, Cause
from node_support.timing import stretches
from sonar_processing.beams.beam import Beam

_CERTAIN = 500.0  # nats: of what needs no comparison of scans to be seen
_MOSTLY = 0.5  # share of the beams that are alike, of some seconds or at twice the range; in turns they shift by bins
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
_STANDS = 20.0  # s: longer than any head waits between two beams, about a turn
_NAMED = 10.0  # s: shorter times in which all directions hear the same are left out, but not named
_STILL = 1e-3  # rad: heads step by ten times as much
_NEVER_TURNS = 0.9  # share of the beams of one angle, from which on the head is not meant to turn
_ALIKE = 0.25  # of the difference of strengths to their sum: beams of one direction have less, of others three times it
# The usual difference, of so many beams, from which on alike ones tell that the head stands: sonars that hear noise
# alone have up to 0.51, those that hear walls 0.76 and more.
_DIFFER, _BEAMS = 0.6, 500
_SPEED = 0.3  # m/s: the usual speed of a small vehicle, which nothing corrects while the head stands


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
    # How many bins are strong, m.
    loud = [np.count_nonzero(beam.intensities > beam.intensities.max() / 2) * beam.range_resolution for beam in heard]
    longer = _change(times, np.array(loud))
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


class HeadStood(NamedTuple):
    """From when to when [s] the head stood; is_told: whether it reported one angle all the time."""

    begin: float
    end: float
    is_told: bool

    @property
    def seconds(self) -> float:
        return self.end - self.begin


def head_stood(beams: Sequence[Beam], usual: float = 0.0) -> Tuple[List[HeadStood], float]:
    """Return when the head stood, of beams in the order of their stamps; told, it did so for more than 20 s.

    The second value tells how different beams of two directions are when the head turns: 0 equal, 1 nothing in common.
    It is never less than `usual`, which is that of earlier beams.
    """
    times = np.array([beam.stamp_ns for beam in beams]) * 1e-9
    angles = np.array([beam.angle for beam in beams])
    untold, usual = _untold(times, angles, beams, usual)
    return [*_told(times, angles), *untold], usual


def of_standing(stood: Sequence[HeadStood]) -> List[Cause]:
    """Return the causes: of each time that was told, and of the longest that was not."""
    told = [one for one in stood if one.is_told]
    untold = [one for one in stood if not one.is_told and one.seconds >= _NAMED]
    longest = [max(untold, key=lambda one: one.seconds)] if untold else []
    causes = []
    for one in (*told, *longest):
        text = f"the head stood for {one.seconds:.0f} s{'' if one.is_told else ' though it reported that it turns'},"
        gone = _SPEED * float(np.sqrt(one.seconds * _STANDS)) / 2.0
        causes.append(Cause(text, CERTAIN, one.begin, metres=gone))
    return causes


def _told(times: np.ndarray, angles: np.ndarray) -> List[HeadStood]:
    """Return stretches in which the head reports one angle, unless it never turns."""
    still = _are_equal(angles[1:], angles[:-1])
    if not len(still) or still.mean() > _NEVER_TURNS:
        return []
    found = [HeadStood(float(times[first]), float(times[last]), True) for first, last in stretches(still)]
    return [one for one in found if one.seconds > _STANDS]


def _untold(
    times: np.ndarray, angles: np.ndarray, beams: Sequence[Beam], usual: float
) -> Tuple[List[HeadStood], float]:  # fmt: skip
    """Return stretches in which all directions hear the same, though the head reports that it turns."""
    apart = max(len(beams) // 400, 10)  # beams after which the head usually looks elsewhere
    strengths = [beam.intensities.astype(np.float32) for beam in beams]
    differences = np.array([_difference(*pair) for pair in zip(strengths, strengths[apart:])])
    told = np.isfinite(differences) & ~_are_equal(angles[apart:], angles[:-apart])
    count = int(np.count_nonzero(told))
    if count >= 2 * apart:
        parts = np.array_split(differences[told], max(count // _BEAMS, 1))
        usual = max(usual, *(float(np.median(part)) for part in parts))
    near = np.ones(6 * apart + 1) / (6 * apart + 1)
    if len(differences) < len(near) or usual < _DIFFER:
        return [], usual
    share = np.convolve(np.where(told, differences, np.inf) < _ALIKE, near, "same")
    found = stretches(share > _MOSTLY)
    return [HeadStood(float(times[first]), float(times[last - 1 + apart]), False) for first, last in found], usual


def _difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return how different the strengths of two beams are: 0 equal, 1 nothing in common; NaN where both are silent."""
    if len(one) != len(other):
        return 1.0
    total = float(one.sum() + other.sum())
    return float(np.abs(one - other).sum()) / total if total else np.nan


def _are_equal(angles: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.abs(np.angle(np.exp(1j * (angles - others)))) < _STILL
