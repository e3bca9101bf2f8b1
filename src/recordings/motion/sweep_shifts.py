"""Whether a vehicle of which nothing but beams is known stood still: by how sweeps of its head lie on each other."""

from dataclasses import dataclass
from enum import Enum
from itertools import islice
from typing import Iterable, Iterator, List, Optional, Tuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from node_support.geometry import FULL_TURN, wrapped
from sonar_processing.beams.beam import Beam, PlacedBeam, has_other_bins
from sonar_processing.scans.assembler import RevolutionCollector

_SECTOR = np.pi / 4.0  # rad: within it a shift of the vehicle moves all echoes in about the same direction
_FEWEST_BEAMS = 6  # of a sector
_HEARD = 0.8  # share of its beams that both sweeps have
_BIN = 0.05  # m: fine enough for the shifts that matter; sonars of short range have finer bins
_BLUR = 2.0  # of these bins: standard deviation, less than an echo is long
_NEAREST = 0.75  # m: nearer, the head itself rings
_FARTHEST_SHIFT = 5.0  # m, of echoes from sweep to sweep
_SEEN_TWICE = 0.35  # least correlation of two sectors that show the same; noise has 0.2
_FEWEST_SECTORS = 4  # that two sweeps show
_MOST_SWEEPS = 100
_PLAY_STEPS, _PLAY_BINS = 1, 2  # by which sweeps of a standing head differ: its gears, and speckle
# Quarters of the correlation without a shift over the best one; walls along the way let half of them be 1. A head in a
# tank has 0.83, one that swung on its cable 0.47, a vehicle at 0.2 m/s 0.01.
_STILL, _MOVING = 0.8, 0.2


class SweepMotion(Enum):
    """What sweeps tell."""

    STILL = "still"
    DRIFTING = "drifting"
    MOVING = "moving"
    UNTOLD = "not told"

    @property
    def is_motion(self) -> bool:
        """Whether they tell that the vehicle did not stand still."""
        return self in (SweepMotion.DRIFTING, SweepMotion.MOVING)


@dataclass(frozen=True)
class SweepShifts:
    """ratios: (n,) of sectors that two sweeps one after the other heard: correlation as they are over the best one."""

    ratios: np.ndarray

    @property
    def motion(self) -> SweepMotion:
        """What they tell; UNTOLD where hardly any sector was heard twice."""
        if len(self.ratios) < _FEWEST_SECTORS:
            return SweepMotion.UNTOLD
        if self._quarter >= _STILL:
            return SweepMotion.STILL
        return SweepMotion.MOVING if self._quarter < _MOVING else SweepMotion.DRIFTING

    @property
    def _quarter(self) -> float:
        return float(np.quantile(self.ratios, 0.25))

    def __str__(self) -> str:
        """Return in words what was measured."""
        if self.motion is SweepMotion.UNTOLD:
            return f"only {len(self.ratios)} sectors sound alike in two sweeps, which does not tell whether it moved"
        fit = f"at least {max(self._quarter, 0.0):.0%} as well as they would shifted"
        needed = f"{_STILL:.0%} speak for a head that stands"
        return f"three of four of {len(self.ratios)} sectors fit the sweep before {fit}; {needed}"


def sweep_shifts(beams: Iterable[Beam]) -> SweepShifts:
    """Return how the first hundred turns or sweeps in `beams`, oldest first, lie on those before them."""
    ratios: List[float] = []
    before: Optional[List[Beam]] = None
    for sweep in islice(_sweeps(beams), _MOST_SWEEPS):
        if before is not None and not has_other_bins(sweep[0], before[0]):
            ratios += _ratios(*_images(before, sweep))
        before = sweep
    return SweepShifts(np.array(ratios))


def _sweeps(beams: Iterable[Beam]) -> Iterator[List[Beam]]:
    collector = RevolutionCollector()
    for beam in beams:
        sweep = collector.add(PlacedBeam(beam, np.eye(4), is_moving=False))
        if sweep is not None and len(sweep) >= _FEWEST_BEAMS:
            yield [placed.beam for placed in sweep]


def _images(before: List[Beam], sweep: List[Beam]) -> Tuple[np.ndarray, np.ndarray, float, float]:
    """Return both sweeps as images (angles, bins), NaN where no beam was sent, their step [rad] and bins' length [m].

    Echoes that all directions have, as of the head itself, are taken off.
    """
    angles = [np.array([beam.angle for beam in one]) for one in (before, sweep)]
    steps = np.abs(wrapped(np.diff(angles[1])))
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else FULL_TURN
    length = sweep[0].range_resolution
    joined = max(round(_BIN / length), 1)
    images = [_image(one, own, step, joined) for one, own in zip((before, sweep), angles)]
    usual = np.nanmedian(np.concatenate(images), axis=0)
    nearest = int(_NEAREST / (joined * length))
    for image in images:
        # The root, so that one strong echo does not count for all others.
        np.sqrt(np.maximum(image - usual, 0.0), out=image)
    before_far, sweep_far = (image[:, nearest:] for image in images)
    return before_far, sweep_far, step, joined * length


def _image(sweep: List[Beam], angles: np.ndarray, step: float, joined: int) -> np.ndarray:
    strengths = np.stack([beam.intensities for beam in sweep]).astype(np.float64)
    bins = strengths.shape[1] // joined
    strengths = strengths[:, : bins * joined].reshape(len(sweep), bins, joined).mean(axis=2)
    rows = max(round(FULL_TURN / step), 1)
    image = np.full((rows, bins), np.nan)
    image[np.rint(angles / step).astype(np.int64) % rows] = strengths
    return image


def _ratios(before: np.ndarray, sweep: np.ndarray, step: float, bin_length: float) -> List[float]:
    """Return for each sector that both heard how well it correlates as it is, over the best shift."""
    width = max(round(_SECTOR / step), _FEWEST_BEAMS)
    heard = np.isfinite(before[:, 0]) & np.isfinite(sweep[:, 0])
    farthest = round(_FARTHEST_SHIFT / bin_length)
    found = []
    for start in range(0, len(heard) - width + 1, width):
        rows = slice(start, start + width)
        if heard[rows].mean() >= _HEARD:
            best, unshifted = _correlations(*(np.nan_to_num(image[rows]) for image in (before, sweep)), farthest)
            if best >= _SEEN_TWICE:
                found.append(unshifted / best)
    return found


def _correlations(before: np.ndarray, sweep: np.ndarray, farthest: int) -> Tuple[float, float]:
    """Return the best correlation of two images over shifts by up to half of their angles, and the one without."""
    # The mean is taken off: two images of speckle would correlate best where they cover each other.
    one, other = (gaussian_filter1d(image - image.mean(), _BLUR, axis=1) for image in (before, sweep))
    size = [2 * length for length in one.shape]
    product = np.conj(np.fft.rfft2(one, size)) * np.fft.rfft2(other, size)
    scale = np.sqrt((one**2).sum() * (other**2).sum())
    if scale == 0.0:
        return 0.0, 0.0
    correlation = np.fft.irfft2(product, size) / scale
    angles, ranges = np.arange(-(len(one) // 2), len(one) // 2 + 1), np.arange(-farthest, farthest + 1)
    some, bins = np.arange(-_PLAY_STEPS, _PLAY_STEPS + 1), np.arange(-_PLAY_BINS, _PLAY_BINS + 1)
    return float(correlation[np.ix_(angles, ranges)].max()), float(correlation[np.ix_(some, bins)].max())
