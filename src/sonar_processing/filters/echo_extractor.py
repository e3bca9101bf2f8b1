"""Finds the few points of a polar scan that are echoes of something, for scan matching (beyond the thesis).

A wide vertical beam above a floor hears the floor in every direction at about the same range: a ring that travels with
the vehicle, onto which every matcher locks. What is heard at a range in most directions is therefore taken off before
echoes are looked for.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Optional, Tuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from node_support.errors import RefusedInput
from node_support.parameters import ParameterSet, parameter
from sonar_processing.cloud import HIGHEST_STRENGTH, Cloud
from sonar_processing.filters.echo_peaks import Peaks, find_peaks, leading_edges, points_along_runs
from sonar_processing.filters.threshold import otsu_threshold

FEWEST_BEAMS = 10  # Fewer directions tell no quantile over them
_SMALLEST_SIGMA_BINS = 0.5  # Bins: a narrower Gaussian is no longer one when it is sampled
_SPREAD = 0.1  # Share of the directions: next to the quantile, so that walls do not count as spread
_SPREAD_SIGMAS = 4.0  # The spread is smoothed over the width of a filtered echo, both of its tails included
_ROWS_MEASURED = 8  # Rows of a cloud that tell the length of a bin; it is the same in all of them


class ExtractionMode(Enum):
    """Which points of an echo are taken."""

    MATCHED_FILTER = "MATCHED_FILTER"
    LEADING_EDGE = "LEADING_EDGE"
    DENSE = "DENSE"


@dataclass(frozen=True)
class EchoExtractorParameters(ParameterSet):
    """Parameters of echo_extractor."""

    mode: ExtractionMode = parameter(
        ExtractionMode.MATCHED_FILTER,
        "which points of an echo are kept: its peak, its beginning, or points all along it",
    )
    pulse_sigma: float = parameter(
        0.15, "standard deviation of an echo along range, the width of the matched filter",
        unit="m", low=0.001, high=10.0,
    )  # fmt: skip
    ring_quantile: float = parameter(
        0.4, "quantile over the directions that makes the ring of floor echoes: 0.3 among walls, 0.5 in open water; "
        "0: no ring, for sectors",
        low=0.0, high=0.9,
    )  # fmt: skip
    min_contrast: float = parameter(
        8.0, "least height of an echo above the ring, as a multiple of the ring's spread; 15 in open water",
        low=0.0, high=100.0,
    )  # fmt: skip
    min_height: float = parameter(
        10.0, "least height of an echo above the ring", unit="echo strength", low=0.0, high=255.0
    )
    threshold_share: float = parameter(
        1.0, "share of Otsu's threshold that an echo must reach; 0.5 keeps weak echoes, and more speckle",
        low=0.0, high=1.0,
    )  # fmt: skip
    min_range: float = parameter(
        0.5, "nearer echoes are removed: there the head itself rings", unit="m", low=0.0, high=100.0
    )
    spacing: float = parameter(0.5, "DENSE: distance between the points of an echo", unit="m", low=0.01, high=100.0)


DEFAULTS = EchoExtractorParameters()


def extract_echoes(
    strengths: np.ndarray, range_resolution: float, parameters: EchoExtractorParameters = DEFAULTS
) -> Tuple[Peaks, float]:
    """Return the echoes of a polar scan, and the height that separated them from speckle.

    strengths: (beams, bins), any numeric type, the beams of one turn in any order; range_resolution: length of a bin,
    m. A height is the strength by which an echo stands out of the ring. Raises RefusedInput for a scan of too few beams
    to tell a ring from echoes.
    """
    sigma = max(parameters.pulse_sigma / range_resolution, _SMALLEST_SIGMA_BINS)
    first_bin = max(math.ceil(parameters.min_range / range_resolution - 0.5), 0)
    smooth = matched_filter(strengths, sigma, first_bin)
    ring, spread = ring_of(smooth, parameters.ring_quantile, sigma)
    response = np.maximum(smooth - ring, 0.0, out=smooth)
    peaks = find_peaks(response, apart=math.ceil(2.0 * sigma))
    least = np.maximum(parameters.min_contrast * spread, parameters.min_height)
    peaks = peaks.select(peaks.heights >= least[np.rint(peaks.bins).astype(np.int64)])
    threshold = max(parameters.threshold_share * height_threshold(peaks.heights), parameters.min_height)
    peaks = peaks.select(peaks.heights >= threshold)
    if parameters.mode is ExtractionMode.LEADING_EDGE:
        peaks = leading_edges(response, peaks)
    elif parameters.mode is ExtractionMode.DENSE:
        peaks = points_along_runs(response, threshold, parameters.spacing / range_resolution)
    return peaks, threshold


def matched_filter(strengths: np.ndarray, sigma: float, first_bin: int = 0) -> np.ndarray:
    """Return (beams, bins) float32: strengths through a Gaussian of `sigma` bins along range.

    Beyond the first and the last bin nothing is heard, and neither before `first_bin`.
    """
    heard = strengths.astype(np.float32)
    heard[:, :first_bin] = 0.0
    return gaussian_filter1d(heard, sigma, axis=1, mode="constant")


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
    return ring, uniform_filter1d(upper - ring, 2 * math.ceil(_SPREAD_SIGMAS * sigma) + 1)


def height_threshold(heights: np.ndarray) -> float:
    """Return Otsu's threshold for the `heights` (n,) of peaks, 0 without peaks.

    Never above half of the highest: in a scan without speckle, as of a sonar that sends two strengths only, Otsu would
    part echoes from echoes.
    """
    if heights.size == 0:
        return 0.0
    highest = float(heights.max())
    scaled = otsu_threshold(heights * (HIGHEST_STRENGTH / highest)) * highest / HIGHEST_STRENGTH
    return min(scaled, highest / 2.0)


class EchoExtractor:
    """Works on whole scans; a moving vehicle makes no difference, for every bin brings its own place."""

    def __init__(self, parameters: EchoExtractorParameters) -> None:
        self.parameters = parameters
        self.newest_threshold: Optional[float] = None
        """The height that parted echoes from speckle in the newest scan."""

    def __call__(self, cloud: Cloud) -> Cloud:
        """Return the echoes of an organised cloud (rows are beams, columns are bins) as a cloud without order.

        The strength of a point is the height by which its echo stands out. Bins that a stage removed (NaN) are silent,
        and no echo lies on them. Raises RefusedInput for a cloud that is not organised or of too few beams.
        """
        if not cloud.is_organized:
            raise RefusedInput("clouds refused", "not organised; subscribe the echo extractor to sonar/scan/polar")
        rows = cloud.points.reshape(cloud.height, -1, 4)
        strengths = np.nan_to_num(rows[..., 3], nan=0.0, posinf=0.0, neginf=0.0)
        echoes, self.newest_threshold = extract_echoes(strengths, bin_length(rows), self.parameters)
        points = places(rows, echoes.beams, echoes.bins)
        points[:, 3] = echoes.heights
        stamps = cloud.time_stamps.reshape(cloud.height, -1)[echoes.beams, 0]
        found = Cloud(points, stamps, cloud.stamp_ns, cloud.frame_id)
        return found.select(found.valid)


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


def places(rows: np.ndarray, beams: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """Return (n, 4) float32: the points between the bins of an organised cloud (beams, bins, 4).

    Bins before the first or after the last lie on the continued beam.
    """
    lower = np.clip(np.floor(bins).astype(np.int64), 0, max(rows.shape[1] - 2, 0))
    upper = np.minimum(lower + 1, rows.shape[1] - 1)
    share = (bins - lower).astype(np.float32)[:, np.newaxis]
    return rows[beams, lower] * (1.0 - share) + rows[beams, upper] * share
