"""Finds the few points of a polar scan that are echoes of something, for scan matching (beyond the thesis).

A wide vertical beam above a floor hears the floor in every direction at about the same range: a ring that travels with
the vehicle, onto which every matcher locks. What is heard at a range in most directions is therefore taken off before
echoes are looked for.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Optional, Tuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter, uniform_filter1d

from node_support.errors import RefusedInput
from node_support.parameters import ParameterSet, parameter
from sonar_processing.cloud import Cloud
from sonar_processing.filters.echo_peaks import EchoStatistics, Peaks, find_peaks, leading_edges, points_along_runs
from sonar_processing.filters.threshold import height_threshold

FEWEST_BEAMS = 6  # Fewer directions tell no quantile over them
_SMALLEST_SIGMA_BINS = 0.5  # Bins: a narrower Gaussian is no longer one when it is sampled
_SPREAD = 0.1  # Share of the directions: next to the quantile, so that walls do not count as spread
_SPREAD_SIGMAS = 4.0  # The spread is smoothed over the width of a filtered echo, both of its tails included
_HEARD = 0.5  # Least strength of a background; the filter's tails of echoes are weaker
_DULL = 0.1  # Share of the loud directions' background; directions with less are hidden, as by the hull
_BACKGROUND = 0.75  # Quantile along a beam that is its background; behind a near wall a beam hears none
_LOUD = 0.9  # Quantile over the directions that is loud
_ROWS_MEASURED = 8  # Rows of a cloud that tell the length of a bin; it is the same in all of them
_ROUNDING = 1e-3  # Bins: the length of a bin is known from float32 points, which move by this with the mount
_NARROW = np.pi / 2.0  # rad: in a narrower sector a wall ahead is heard at one range in most directions, as a ring is
_PROFILE = 4.0  # m along range: what is longer than that is no wall
_EDGE_SIGMA = 0.15  # m: of the filter for plateaus, which closes gaps and leaves an edge where it is


class ExtractionMode(Enum):
    """Which points of an echo are taken. AUTO: MATCHED_FILTER where echoes have peaks, DENSE where they have not."""

    AUTO = "AUTO"
    MATCHED_FILTER = "MATCHED_FILTER"
    LEADING_EDGE = "LEADING_EDGE"
    DENSE = "DENSE"


@dataclass(frozen=True)
class EchoExtractorParameters(ParameterSet):
    mode: ExtractionMode = parameter(
        ExtractionMode.AUTO,
        "which points of an echo are kept: its peak, its beginning, or points all along it; AUTO: peaks, or points all "
        "along where the sonar sends two strengths only",
    )
    pulse_sigma: float = parameter(
        0.15, "standard deviation of an echo along range, the width of the matched filter; 0: measured",
        unit="m", low=0.0, high=10.0,
    )  # fmt: skip
    ring_quantile: float = parameter(
        0.4, "quantile over the directions that makes the ring of floor echoes: 0.3 among walls, 0.5 in open water; "
        "0: no ring",
        low=0.0, high=0.9,
    )  # fmt: skip
    min_contrast: float = parameter(
        8.0, "least height of an echo above the ring, as a multiple of the ring's spread; 15 in open water",
        low=0.0, high=100.0,
    )  # fmt: skip
    min_height: float = parameter(10.0, "least height above the ring", unit="echo strength", low=0.0, high=255.0)
    threshold_share: float = parameter(
        1.0, "share of Otsu's threshold that a peak must reach: 1 keeps strong echoes only; DENSE always takes 1",
        low=0.0, high=1.0,
    )  # fmt: skip
    min_range: float = parameter(0.5, "nearer echoes are removed: there the head rings", unit="m", low=0.0, high=100.0)
    spacing: float = parameter(1.0, "DENSE: distance between the points of an echo", unit="m", low=0.01, high=100.0)

    @property
    def is_settled(self) -> bool:
        """Whether nothing is left to be found out from the echoes."""
        return self.mode is not ExtractionMode.AUTO and self.pulse_sigma > 0.0

    def settled(self, heard: EchoStatistics) -> "EchoExtractorParameters":
        """Return them with what is left open taken from the echoes that were heard."""
        mode, sigma = self.mode, self.pulse_sigma
        if mode is ExtractionMode.AUTO:
            mode = ExtractionMode.DENSE if heard.are_plateaus else ExtractionMode.MATCHED_FILTER
        if not sigma:
            sigma = _EDGE_SIGMA if mode is ExtractionMode.DENSE else round(heard.sigma, 3)
        return replace(self, mode=mode, pulse_sigma=sigma)


def extract_echoes(
    strengths: np.ndarray, range_resolution: float, parameters: EchoExtractorParameters, is_narrow: bool = False
) -> Tuple[Peaks, float]:
    """Return the echoes of a polar scan, and the height that separated them from speckle.

    strengths: (beams, bins), any numeric type, the beams of one turn in any order; range_resolution: length of a bin,
    m. parameters: settled ones. is_narrow: of a sector in which no ring can be told from a wall ahead; then the ring is
    only what is heard along several metres. A height is the strength by which an echo stands out of the ring. Raises
    RefusedInput for a scan of too few beams to tell a ring from echoes.
    """
    is_dense = parameters.mode is ExtractionMode.DENSE
    sigma = max(parameters.pulse_sigma / range_resolution, _SMALLEST_SIGMA_BINS)
    heard = strengths.astype(np.float32)
    heard[:, : max(_bins_above(parameters.min_range / range_resolution - 0.5), 0)] = 0.0
    smooth = gaussian_filter1d(heard, sigma, axis=1, mode="constant")
    ring, spread = ring_of(smooth if is_dense else _hearing(smooth), parameters.ring_quantile, sigma)
    if is_narrow:
        around = 2 * (_bins_above(_PROFILE / range_resolution) // 2) + 1
        ring, spread = (np.minimum(one, median_filter(one, around, mode="nearest")) for one in (ring, spread))
    response = np.maximum(smooth - ring, 0.0, out=smooth)
    peaks = find_peaks(response, apart=_bins_above(2.0 * sigma))
    least = np.maximum(parameters.min_contrast * spread, parameters.min_height)
    peaks = peaks.select(peaks.heights >= least[np.rint(peaks.bins).astype(np.int64)])
    share = 1.0 if is_dense else parameters.threshold_share
    threshold = max(share * height_threshold(peaks.heights), parameters.min_height)
    peaks = peaks.select(peaks.heights >= threshold)
    if parameters.mode is ExtractionMode.LEADING_EDGE:
        peaks = leading_edges(response, peaks)
    elif is_dense:
        peaks = points_along_runs(response, threshold, parameters.spacing / range_resolution)
    return peaks, threshold


def ring_of(smooth: np.ndarray, quantile: float, sigma: float) -> Tuple[np.ndarray, np.ndarray]:
    """Return strength and spread (bins,) of what is heard at each range in most directions.

    The strength is the `quantile` over the directions, the spread the distance to the quantile `_SPREAD` higher,
    averaged over some `sigma` bins: about a quarter of a standard deviation of normal speckle. A quantile of 0 means
    that there is no ring. Raises RefusedInput for fewer than `FEWEST_BEAMS` beams where there is one.
    """
    beams, bins = smooth.shape
    if quantile == 0.0:
        return np.zeros(bins, np.float32), np.zeros(bins, np.float32)
    if beams < FEWEST_BEAMS:
        raise RefusedInput("scans of too few beams", f"{beams}, must be at least {FEWEST_BEAMS} to see a ring")
    ranks = [int(share * (beams - 1)) for share in (quantile, min(quantile + _SPREAD, 1.0))]
    ordered = np.partition(smooth, ranks, axis=0)
    ring, upper = ordered[ranks[0]], ordered[ranks[1]]
    return ring, uniform_filter1d(upper - ring, 2 * _bins_above(_SPREAD_SIGMAS * sigma) + 1)


def _hearing(smooth: np.ndarray) -> np.ndarray:
    """Return the beams (k, bins) that hear a background; all of them in a scan without one, or where too few do.

    The others, as those behind the hull, do not tell whether there is a ring.
    """
    background = np.quantile(smooth, _BACKGROUND, axis=1)
    loud = np.quantile(background, _LOUD)
    hearing = background >= _DULL * loud
    return smooth[hearing] if loud >= _HEARD and np.count_nonzero(hearing) >= FEWEST_BEAMS else smooth


def _bins_above(width: float) -> int:
    """Return the least number of bins above a width [bins], also above a whole number from which rounding takes."""
    return math.floor(width + _ROUNDING) + 1


class EchoExtractor:
    """Works on whole scans; a moving vehicle makes no difference, for every bin brings its own place.

    What the parameters leave open is found out from the beams of all scans with the same bins, the newest included.
    Other bins, or a time that jumps back, begin anew.
    """

    def __init__(self, parameters: EchoExtractorParameters) -> None:
        self.parameters = parameters
        self.newest_parameters = parameters  # of the newest scan, with what was found out
        self.newest_threshold: Optional[float] = None  # the height that parted its echoes from speckle
        self._heard: Optional[EchoStatistics] = None
        self._newest_ns = 0

    def __call__(self, cloud: Cloud) -> Cloud:
        """Return the echoes of an organised cloud (rows are beams, columns are bins) as a cloud without order.

        The strength of a point is the height by which its echo stands out. Bins that a stage removed (NaN) are silent,
        and no echo lies on them. Raises RefusedInput for a cloud that is not organised or of too few beams.
        """
        if not cloud.organized:
            raise RefusedInput("clouds refused", "not organised; subscribe the echo extractor to sonar/scan/polar")
        rows = cloud.points.reshape(cloud.height, -1, 4)
        strengths = np.nan_to_num(rows[..., 3], nan=0.0, posinf=0.0, neginf=0.0)
        resolution = bin_length(rows)
        if not self.parameters.is_settled:
            self.newest_parameters = self.parameters.settled(self._heard_with(strengths, resolution, cloud.stamp_ns))
        is_narrow = width_of(rows) < _NARROW
        echoes, self.newest_threshold = extract_echoes(strengths, resolution, self.newest_parameters, is_narrow)
        points = places(rows, echoes.beams, echoes.bins)
        points[:, 3] = echoes.heights
        stamps = cloud.time_stamps.reshape(cloud.height, -1)[echoes.beams, 0]
        found = Cloud(points, stamps, cloud.stamp_ns, cloud.frame_id)
        return found.select(found.valid)

    def _heard_with(self, strengths: np.ndarray, resolution: float, stamp_ns: int) -> EchoStatistics:
        """Return what was heard since the bins changed or time jumped, the scan included."""
        bins, heard = strengths.shape[1], self._heard
        if heard is None or stamp_ns < self._newest_ns or not heard.has_bins(bins, resolution):
            self._heard = EchoStatistics(bins, resolution)
        self._newest_ns = stamp_ns
        self._heard.add(strengths)
        return self._heard


def bin_length(rows: np.ndarray) -> float:
    """Return the distance between neighbouring bins of an organised cloud (beams, bins, 4), m.

    Raises RefusedInput when no two neighbours are left to tell it from.
    """
    some = rows[:: max(len(rows) // _ROWS_MEASURED, 1), :, :3]
    lengths = np.linalg.norm(np.diff(some, axis=1), axis=2)
    lengths = lengths[np.isfinite(lengths)]
    lengths = lengths[lengths > 0.0]
    if lengths.size == 0:
        raise RefusedInput("clouds refused", "no two neighbouring bins are left; check min_range and height_limit")
    return float(np.median(lengths))


def width_of(rows: np.ndarray) -> float:
    """Return by how much the head turned in an organised cloud (beams, bins, 4), rad; infinite where it is unknown."""
    ahead = rows[:, -1, :3] - rows[:, rows.shape[1] // 2, :3]
    lengths = np.linalg.norm(ahead, axis=1)
    if not (np.isfinite(lengths).all() and lengths.all()):
        return np.inf
    ahead = ahead / lengths[:, np.newaxis]
    return float(np.arccos(np.clip((ahead[1:] * ahead[:-1]).sum(axis=1), -1.0, 1.0)).sum())


def places(rows: np.ndarray, beams: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """Return (n, 4) float32: the points between the bins of an organised cloud (beams, bins, 4).

    Bins before the first or after the last lie on the continued beam.
    """
    lower = np.clip(np.floor(bins).astype(np.int64), 0, max(rows.shape[1] - 2, 0))
    upper = np.minimum(lower + 1, rows.shape[1] - 1)
    share = (bins - lower).astype(np.float32)[:, np.newaxis]
    return rows[beams, lower] * (1.0 - share) + rows[beams, upper] * share
