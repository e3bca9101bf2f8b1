"""Keeps the strong echoes (thesis 6.5.3)."""

from dataclasses import dataclass
from enum import Enum
from typing import Optional

import numpy as np

from node_support.errors import RefusedInput
from node_support.parameters import ParameterSet, parameter
from sonar_processing.cloud import HIGHEST_STRENGTH, Cloud


class ThresholdMode(Enum):
    OTSU = "OTSU"
    FIXED = "FIXED"
    PROPORTIONAL = "PROPORTIONAL"
    OTSU_PROPORTIONAL = "OTSU+PROPORTIONAL"


@dataclass(frozen=True)
class ThresholderParameters(ParameterSet):
    mode: ThresholdMode = parameter(ThresholdMode.OTSU_PROPORTIONAL, "how the threshold is chosen", thesis_name="mode")
    fixed_threshold: float = parameter(
        66.0, "threshold of mode FIXED", unit="echo strength", low=0.0, high=255.0, thesis_name="fixedThresholdValue"
    )
    otsu_multiplier: float = parameter(
        1.4, "factor on Otsu's threshold in OTSU+PROPORTIONAL", low=0.0, high=10.0, thesis_name="OTSUMultiplier"
    )
    otsu_nonzero: bool = parameter(True, "give Otsu only the strengths above zero")
    max_proportion: float = parameter(
        0.5, "share of the strongest echo in PROPORTIONAL", low=0.0, high=1.0, thesis_name="maxThresholdProportion"
    )
    min_proportion: float = parameter(
        0.5, "share of the weakest echo in PROPORTIONAL", low=0.0, high=1.0, thesis_name="minThresholdProportion"
    )
    min_threshold: float = parameter(
        0.0, "the threshold is never below this", unit="echo strength", low=0.0, high=255.0,
        thesis_name="minThreshold",
    )  # fmt: skip


class Thresholder:
    """Removes the points whose strength is not above the threshold."""

    def __init__(self, parameters: ThresholderParameters) -> None:
        self.parameters = parameters
        # Here, because it loads numba (0.3 s, 90 MB), which nodes without a threshold do without.
        from sonar_processing.filters import compiled_strengths

        self._loops = compiled_strengths
        # Of the newest cloud; None before the first and for a cloud without a finite point.
        self.newest_threshold: Optional[float] = None

    def __call__(self, cloud: Cloud) -> Cloud:
        """Return the cloud's strong points; a cloud without a finite point comes back without points.

        Echoes are what lies above the threshold, as in Otsu's upper class.
        """
        points, stamps = np.ascontiguousarray(cloud.points), np.ascontiguousarray(cloud.time_stamps)
        counts, ends = self._loops.count_strengths(points, stamps)
        self.newest_threshold = self._threshold(counts, *ends.tolist()) if counts.any() else None
        if self.newest_threshold is None:
            return cloud.take(np.empty(0, dtype=np.int64))
        return cloud.take(self._loops.strong_points(points, stamps, np.float32(self.newest_threshold)))

    def _threshold(self, counts: np.ndarray, lowest: float, highest: float, weakest: float) -> float:
        """Return the threshold of a cloud with a finite point.

        counts: (257,) int64, how many strengths above 0 lie in each integer level, and the number of the others.
        lowest, highest: of all strengths. weakest: of those above 0.

        OTSU and OTSU+PROPORTIONAL separate strong echoes from weak ones. Where all strengths above 0 are the same,
        somebody has separated them already (a recording of detections): then their threshold is 0, or min_threshold if
        that is higher, and all of them pass. FIXED and PROPORTIONAL make no such exception.
        """
        parameters = self.parameters
        if parameters.mode is ThresholdMode.FIXED:
            value = parameters.fixed_threshold
        elif parameters.mode is ThresholdMode.PROPORTIONAL:
            value = parameters.max_proportion * highest + parameters.min_proportion * lowest
        elif weakest < highest:
            levels, silent = counts[:-1].copy(), counts[-1]
            if not parameters.otsu_nonzero:
                levels[0] += silent
            factor = 1.0 if parameters.mode is ThresholdMode.OTSU else parameters.otsu_multiplier
            value = factor * self._loops.threshold_of_levels(levels)
        else:
            value = 0.0
        return max(value, parameters.min_threshold)


def otsu_threshold(strengths: np.ndarray) -> float:
    """Return the strength that separates echoes from background best; echoes are the points above it.

    strengths: (n,) any numeric type; they are counted in integer levels 0 to 255, what lies outside in the nearest.
    The result is the mean of the first and the last level that maximise the between-class variance (6.1 to 6.4); with
    one level only there is nothing to separate and that level is returned. Raises RefusedInput when `strengths` is
    empty.
    """
    if strengths.size == 0:
        raise RefusedInput("clouds without points", "no strength to take a threshold of")
    from sonar_processing.filters.compiled_strengths import threshold_of_levels

    levels = np.clip(strengths, 0, HIGHEST_STRENGTH).astype(np.int64)
    return threshold_of_levels(np.bincount(levels, minlength=HIGHEST_STRENGTH + 1))


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
