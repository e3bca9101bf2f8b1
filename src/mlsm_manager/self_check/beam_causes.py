"""Causes that beams show by themselves: a head that stands, a blind side, and settings that changed in mid-run."""

from typing import Callable, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.sonar_trials import SonarFault, SonarKind
from mlsm_manager.self_check.causes import Cause
from node_support.timing import stretches
from sonar_processing.beams.beam import PlacedBeam

_CERTAIN = 500.0  # nats: of what needs no comparison of scans to be seen
_STANDS = 20.0  # s: longer than any head waits between two beams, about a turn
_STILL = 1e-3  # rad: heads step by ten times as much
_ALIKE = 0.25  # of the difference of strengths to their sum: beams of one direction have less, of others three times it
_MOSTLY = 0.5  # share of the beams of some seconds that are alike; where the vehicle turns they shift by bins
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
_SPEED = 0.3  # m/s: the usual speed of a small vehicle, which nothing corrects while the head stands


def of_trembling(degrees: float, is_mended: bool) -> Cause:
    """Return the cause for a head whose reported angles tremble; is_mended: whether they are those of its turn now."""
    return Cause(f"the head's angles tremble by {degrees:.0f} deg", _CERTAIN, is_mended=is_mended, metres=0.5)


def beam_causes(beams: Sequence[PlacedBeam]) -> List[Cause]:
    """Return what the beams of a recording, in the order of their stamps, show."""
    heard = [one for one in beams if one.beam.intensities.any()]
    changed = (_changed(_times(heard), heard, measure, text) for text, measure in _MEASURES)
    return _standing(beams) or [*head_causes(beams)[0], *(cause for cause in changed if cause is not None)]


def head_causes(beams: Sequence[PlacedBeam], usual: float = 0.0) -> Tuple[List[Cause], float]:
    """Return what is wrong with the head, as far as a few minutes of beams show it.

    The second value tells how different beams of two directions usually are: 0 equal, 1 nothing in common. It is never
    less than `usual`, which is that of earlier beams.
    """
    differences = _differences(beams)
    told = differences[np.isfinite(differences)]
    if len(told) >= 2 * _apart(beams):
        usual = max(usual, float(np.median(told)))
    found = (_stuck(beams, differences, usual), _blind(beams), _doubled(beams))
    return _standing(beams) or [cause for cause in found if cause is not None], usual


def _times(beams: Sequence[PlacedBeam]) -> np.ndarray:
    """Return when beams (n,) were sent, s."""
    return np.array([one.beam.stamp_ns for one in beams]) * 1e-9


def _angles(beams: Sequence[PlacedBeam]) -> np.ndarray:
    """Return where the head pointed, (n,) rad."""
    return np.array([one.beam.angle for one in beams])


def ranges_are_told(beams: Sequence[PlacedBeam]) -> bool:
    """Return whether messages tell that the range setting changed: then none changed untold."""
    ranges = [one.beam.range_resolution * len(one.beam.intensities) for one in beams if len(one.beam.intensities)]
    shortest, longest = np.quantile(ranges, _USUAL) if ranges else (0.0, 0.0)
    return bool(longest > _CHANGED * shortest)


def _standing(beams: Sequence[PlacedBeam]) -> List[Cause]:
    """Return stretches in which the head reports one angle, unless it never turns."""
    times, still = _times(beams), np.abs(np.angle(np.exp(1j * np.diff(_angles(beams))))) < _STILL
    if not len(still) or still.mean() > 0.9:
        return []
    found = [(float(times[first]), float(times[last] - times[first])) for first, last in stretches(still)]
    return [
        Cause(f"the head stood for {seconds:.0f} s,", _CERTAIN, begin, metres=_gone(seconds))
        for begin, seconds in found
        if seconds > _STANDS
    ]


def _gone(seconds: float) -> float:
    return _SPEED * float(np.sqrt(seconds * _STANDS)) / 2.0


def _stuck(beams: Sequence[PlacedBeam], differences: np.ndarray, usual: float) -> Optional[Cause]:
    """Return when all directions began to hear the same, though the head reports that it turns."""
    times, apart, told = _times(beams), _apart(beams), np.isfinite(differences)
    if len(differences) < 2 * apart or usual < 2.0 * _ALIKE:
        return None
    near = np.ones(6 * apart + 1) / (6 * apart + 1)
    share = np.convolve(np.where(told, differences, np.inf) < _ALIKE, near, "same")
    alike = stretches(share > _MOSTLY)
    if not alike:
        return None
    first, last = max(alike, key=lambda one: times[one[1]] - times[one[0]])
    seconds = float(times[last] - times[first])
    if seconds < _STANDS / 2.0:
        return None
    text = f"the head stood for {seconds:.0f} s though it reported that it turns,"
    return Cause(text, _CERTAIN, float(times[first]), metres=_gone(seconds))


def _apart(beams: Sequence[PlacedBeam]) -> int:
    """Return how many beams after another one the head usually looks elsewhere."""
    return max(len(beams) // 400, 10)


def _differences(beams: Sequence[PlacedBeam]) -> np.ndarray:
    """Return how different beams are from those some directions on; NaN where both are silent."""
    strengths = [one.beam.intensities.astype(np.float32) for one in beams]
    return np.array([_difference(*pair) for pair in zip(strengths, strengths[_apart(beams) :])])


def _difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return how different the strengths of two beams are: 0 equal, 1 nothing in common; NaN where both are silent."""
    if len(one) != len(other):
        return 1.0
    total = float(one.sum() + other.sum())
    return float(np.abs(one - other).sum()) / total if total else np.nan


def _blind(beams: Sequence[PlacedBeam]) -> Optional[Cause]:
    """Return whether about half of the circle hears nothing, though the head looks there."""
    hears = np.array([bool(one.beam.intensities.any()) for one in beams])
    sector = ((_angles(beams) % (2.0 * np.pi)) / (2.0 * np.pi) * _SECTORS).astype(int) % _SECTORS
    looked = np.bincount(sector, minlength=_SECTORS)
    if looked.min() < 10:
        return None
    share = np.bincount(sector, hears, minlength=_SECTORS) / looked
    longest = max((last - first for first, last in stretches(np.tile(share < _DEAF, 2))), default=0)
    if not _BLIND <= longest < _SECTORS or np.median(share[share >= _DEAF]) < _HEARS:
        return None
    degrees = 360.0 * longest / _SECTORS
    return Cause(f"the sonar hears nothing in {degrees:.0f} deg of its circle", _CERTAIN, metres=0.5)


def _doubled(beams: Sequence[PlacedBeam]) -> Optional[Cause]:
    """Return whether most beams are like themselves at twice the range, more than at any other ratio of ranges."""
    chosen = (one.beam.intensities.astype(float) for one in beams[:: max(len(beams) // _SAMPLE, 1)])
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


def _loudest(placed: PlacedBeam) -> float:
    return float(placed.beam.intensities.max())


def _length(placed: PlacedBeam) -> float:
    """Return how many bins are strong, m."""
    strengths = placed.beam.intensities
    return float(np.count_nonzero(strengths > strengths.max() / 2)) * placed.beam.range_resolution


_MEASURES: Tuple[Tuple[str, Callable[[PlacedBeam], float]], ...] = (
    ("the gain changed: echoes are {ratio:.1f} times as strong from then on", _loudest),
    ("gain, pulse length or range setting changed: echoes are {ratio:.1f} times as long from then on", _length),
)
"""What a change of it means, and what is measured of a beam."""


def _changed(
    times: np.ndarray, beams: Sequence[PlacedBeam], measure: Callable[[PlacedBeam], float], text: str
) -> Optional[Cause]:
    """Return when the median of what is measured of beams (n) at `times` (n,) stepped, where both sides are steady.

    Echoes that are longer than they were may be as long as ever, in reported ranges that are longer than the true ones.
    """
    values = np.array([measure(one) for one in beams])
    if len(times) < _FEWEST:
        return None
    best = (1.0, np.nan, np.nan)
    for moment in np.arange(times[0] + _SIDE, times[-1] - _SIDE, _SIDE / 12.0):
        edges = np.searchsorted(times, moment + _SIDE * _PARTS)
        parts = [values[first:last] for first, last in zip(edges[:-1], edges[1:])]
        if min(len(part) for part in parts) < _FEWEST:
            continue
        medians = np.maximum([float(np.median(part)) for part in parts], 1e-6).reshape(2, -1)
        before, after = np.exp(np.log(medians).mean(axis=1))
        steady = (medians.max(axis=1) / medians.min(axis=1)).max() < _STEADY
        factor = max(before / after, after / before)
        if steady and factor > max(best[0], _CHANGED):
            best = (factor, moment, after / before)
    if np.isnan(best[1]):
        return None
    begin = float(best[1])
    fault = SonarFault(SonarKind.RANGES, begin, (-float(np.log(best[2])),)) if measure is _length else None
    return Cause(text.format(ratio=best[2]), _CERTAIN / 10.0, begin, metres=1.0, fault=fault)
