"""Whether a vehicle of which nothing but beams is known stood still: by how sweeps of its head lie on each other.

Sectors that hold echoes are looked for in later sweeps. Those of a head that stands lie where they were, in sweeps one
after the other as well as in the first and the last; those of one that drifts or moves lie elsewhere, or are lost.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Iterable, List, NamedTuple, Optional, Tuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from node_support.geometry import FULL_TURN, wrapped
from sonar_processing.beams.beam import Beam, PlacedBeam, has_other_bins
from sonar_processing.scans.assembler import turns_of

_SECTOR = np.pi / 4.0  # rad: within it a shift of the vehicle moves all echoes in about the same direction
_FEWEST_BEAMS = 6  # of a sector
_BIN = 0.05  # m: fine enough for the shifts that matter; sonars of short range have finer bins
_BLUR = 2.0  # of these bins: standard deviation, less than an echo is long
_NEAREST = 0.75  # m: nearer, the head itself rings
_FARTHEST_SHIFT = 5.0  # m, of echoes from sweep to sweep
_ALIKE = 0.35  # least correlation of two sectors that show the same, or of the beams of one; noise has 0.2
_MOST_PAIRS = 8  # of sweeps as far apart; more tell little new
_PLAY_STEPS, _PLAY_BINS = 1, 2  # by which sweeps of a standing head differ: its gears, and speckle
_AS_GOOD = 0.9  # of the best correlation: where a sector fits so well without a shift, it was not shifted
# Chances that a direction of the head shows what it showed before, in most sweeps or in few. Of a head that stands few
# show fish, bubbles or noise; to one that drifts some show walls along its way.
_MOSTLY, _SELDOM = 0.9, 0.15
_FEW_WHEN_STILL, _FEW_WHEN_MOVED = 0.15, 0.65
_LIKENESS = 2.0  # sweeps that tell the same
_CERTAIN = 1.4  # nats: a direction that always differs, or two that never do
_TOGETHER = 3.0  # nats of all distances of sweeps: simulated fish and bubbles around a still head seldom have as much
_SLOW = 0.1  # m/s: two deviations of a vehicle that is taken to drift
_SELDOM_SEEN = 0.3  # share of sectors of one sweep that the next one has, of a vehicle that leaves what it heard
_USUAL_PART = np.sqrt(0.5)  # of a motion that shows along one direction: the median over all


class SweepMotion(Enum):
    """What sweeps tell."""

    STILL = "still"
    DRIFTING = "drifting"
    MOVING = "moving"
    UNTOLD = "not told"


class _Apart(NamedTuple):
    """What was found of sectors so many `sweeps` later.

    near: (directions, 2) how many were found where they were, and how many elsewhere or not at all. speed: m/s, the
    median of the latter.
    """

    sweeps: int
    near: np.ndarray
    speed: float

    @property
    def evidence(self) -> float:
        """By how many nats they speak for a head that stands over one that does not."""
        near, elsewhere = self.near.T / _LIKENESS
        often, seldom = (chance**near * (1.0 - chance) ** elsewhere for chance in (_MOSTLY, _SELDOM))
        still, moved = (few * seldom + (1.0 - few) * often for few in (_FEW_WHEN_STILL, _FEW_WHEN_MOVED))
        return float(np.log(still / moved).sum())

    @property
    def leaves(self) -> bool:
        """Whether the vehicle went on so fast that little was heard again."""
        return self.speed > _SLOW and self.near[:, 0].sum() <= _SELDOM_SEEN * self.near.sum()


@dataclass(frozen=True)
class SweepShifts:
    """apart: what sectors told, for each number of sweeps between two that were compared, smallest first."""

    apart: List[_Apart]

    @property
    def motion(self) -> SweepMotion:
        """What they tell; UNTOLD where chance could have made it."""
        evidence = [one.evidence for one in self.apart] or [0.0]
        if min(evidence) <= -_CERTAIN and sum(evidence) <= -_TOGETHER:
            return SweepMotion.MOVING if self.apart[0].leaves else SweepMotion.DRIFTING
        return SweepMotion.STILL if min(evidence) >= 0.0 and max(evidence) >= _CERTAIN else SweepMotion.UNTOLD

    def __str__(self) -> str:
        """Return in words what was measured."""
        if not self.apart:
            return "no sector sounds alike in two sweeps, which does not tell whether it moved"
        tells = min(self.apart, key=lambda one: one.evidence)
        between = f"{tells.sweeps} sweeps later" if tells.sweeps > 1 else "in the next sweep"
        untold = ", which does not tell whether it moved" if self.motion is SweepMotion.UNTOLD else ""
        near, elsewhere = tells.near.sum(axis=0)
        return f"{near} of {near + elsewhere} sectors are heard where they were {between}{untold}"


def sweep_shifts(beams: Iterable[Beam]) -> SweepShifts:
    """Return how turns or sweeps in `beams`, oldest first, lie on those 1, 2, 4 and so on before, up to the first."""
    placed = [PlacedBeam(beam, np.eye(4), is_moving=False) for beam in beams]
    sweeps = [[one.beam for one in turn] for turn in turns_of(placed, _FEWEST_BEAMS)]
    lags = sorted({*(2**power for power in range(len(sweeps).bit_length())), len(sweeps) - 1})
    found = [_apart(sweeps, lag) for lag in lags if 0 < lag < len(sweeps)]
    return SweepShifts([one for one in found if one is not None])


def _apart(sweeps: List[List[Beam]], lag: int) -> Optional[_Apart]:
    pairs = [(one, other) for one, other in zip(sweeps, sweeps[lag:]) if not has_other_bins(one[0], other[0])]
    chosen = np.unique(np.linspace(0, len(pairs) - 1, min(len(pairs), _MOST_PAIRS)).astype(int))
    found = [sector for number in chosen for sector in _found(*pairs[number])]
    if not found:
        return None
    directions, speeds = (np.array(column) for column in zip(*found))
    octants = np.rint(directions / _SECTOR).astype(int) % round(FULL_TURN / _SECTOR)
    heard, number = np.unique(octants, return_inverse=True)
    near = np.zeros((len(heard), 2), dtype=int)
    np.add.at(near, (number, (speeds > 0.0).astype(int)), 1)
    return _Apart(lag, near, float(np.median(speeds[speeds > 0.0])) if (speeds > 0.0).any() else 0.0)


def _found(before: List[Beam], sweep: List[Beam]) -> List[Tuple[float, float]]:
    """Return for each sector with echoes its direction, rad, and the speed by which it is found elsewhere in the other
    sweep, m/s; 0 where it was. Of beams that end where the head itself rings there is none.
    """
    one, other, step, length = _images(before, sweep)
    if not one.shape[1]:
        return []
    seconds = 1e-9 * (np.mean([beam.stamp_ns for beam in sweep]) - np.mean([beam.stamp_ns for beam in before]))
    found = []
    for rows in _sectors(np.isfinite(one[:, 0]) & np.isfinite(other[:, 0]), step):
        metres = _shift(one[rows], other[rows], length)
        if metres is not None:
            found.append((rows[len(rows) // 2] * step, metres / max(seconds, 1e-3) / _USUAL_PART))
    return found


def _sectors(heard: np.ndarray, step: float) -> List[np.ndarray]:
    """Return the rows of each sector in the parts of the circle that both sweeps have, about as wide as `_SECTOR`."""
    start = 0 if heard.all() else int(np.argmin(heard))
    order = np.roll(np.arange(len(heard)), -start)
    bounds = np.flatnonzero(np.diff(heard[order].astype(np.int8))) + 1
    parts = [part for part in np.split(order, bounds) if heard[part[0]] and len(part) >= _FEWEST_BEAMS]
    counts = [max(min(round(len(part) * step / _SECTOR), len(part) // _FEWEST_BEAMS), 1) for part in parts]
    return [rows for part, count in zip(parts, counts) for rows in np.array_split(part, count)]


def _images(before: List[Beam], sweep: List[Beam]) -> Tuple[np.ndarray, np.ndarray, float, float]:
    """Return both sweeps as images (angles, bins), NaN where no beam was sent, their step [rad] and bins' length [m].

    Echoes that all directions have, as of the head itself, are taken off.
    """
    angles = [np.array([beam.angle for beam in one]) for one in (before, sweep)]
    step = max(_usual_step(one) for one in angles)
    joined = max(round(_BIN / sweep[0].range_resolution), 1)
    length = joined * sweep[0].range_resolution
    images = [_image(one, own, step, joined) for one, own in zip((before, sweep), angles)]
    usual = np.nanmedian(np.concatenate(images), axis=0)
    # The root, so that one strong echo does not count for all others.
    far = [np.sqrt(np.maximum(image - usual, 0.0))[:, int(_NEAREST / length) :] for image in images]
    return far[0], far[1], step, length


def _usual_step(angles: np.ndarray) -> float:
    steps = np.abs(wrapped(np.diff(angles)))
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else FULL_TURN


def _image(sweep: List[Beam], angles: np.ndarray, step: float, joined: int) -> np.ndarray:
    strengths = np.stack([beam.intensities for beam in sweep]).astype(np.float64)
    bins = max(strengths.shape[1] // joined, 1)
    strengths = strengths[:, : bins * joined].reshape(len(sweep), bins, -1).mean(axis=2)
    rows = max(round(FULL_TURN / step), 1)
    image = np.full((rows, bins), np.nan)
    image[np.rint(angles / step).astype(np.int64) % rows] = strengths
    return image


def _blurred(image: np.ndarray) -> np.ndarray:
    # The mean is taken off: two images of speckle would correlate best where they cover each other.
    return gaussian_filter1d(image - image.mean(), _BLUR, axis=1)


def _coherence(image: np.ndarray) -> float:
    """Return how well every second beam of a sector correlates with the ones between: noise does not."""
    one, other = (_blurred(image[first::2][: len(image) // 2]) for first in (0, 1))
    scale = np.sqrt((one**2).sum() * (other**2).sum())
    return float((one * other).sum() / scale) if scale > 0.0 else 0.0


def _shift(before: np.ndarray, sweep: np.ndarray, bin_length: float) -> Optional[float]:
    """Return how far a sector is found from where it was, m: 0 if it is there, the farthest if it is lost, None for one
    that holds nothing.
    """
    one, other = _blurred(before), _blurred(sweep)
    scale = np.sqrt((one**2).sum() * (other**2).sum())
    if scale == 0.0:
        return None
    size = [2 * length for length in one.shape]
    product = np.conj(np.fft.rfft2(one, size)) * np.fft.rfft2(other, size)
    farthest = min(round(_FARTHEST_SHIFT / bin_length), one.shape[1] - 1)
    angles, bins = np.arange(-(len(one) // 2), len(one) // 2 + 1), np.arange(-farthest, farthest + 1)
    correlation = np.fft.irfft2(product, size)[np.ix_(angles, bins)] / scale
    best = float(correlation.max())
    if best < _ALIKE:
        return _FARTHEST_SHIFT if min(_coherence(before), _coherence(sweep)) >= _ALIKE else None
    unshifted = correlation[np.abs(angles) <= _PLAY_STEPS][:, np.abs(bins) <= _PLAY_BINS].max()
    shift = abs(int(bins[correlation.argmax() % len(bins)])) * bin_length
    return 0.0 if unshifted >= _AS_GOOD * best else max(shift, bin_length)
