"""Keeps the strong echoes (thesis 6.5.3)."""

from dataclasses import dataclass
from enum import Enum
from typing import Optional

import numpy as np

from node_support.kernels import Kernel, check_kernel
from node_support.parameters import ParameterSet, parameter
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.strengths import StrengthCounts, strength_loops


class ThresholdMode(Enum):
    """How the threshold is chosen."""

    OTSU = "OTSU"
    FIXED = "FIXED"
    PROPORTIONAL = "PROPORTIONAL"
    OTSU_PROPORTIONAL = "OTSU+PROPORTIONAL"


@dataclass(frozen=True)
class ThresholderParameters(ParameterSet):
    """Parameters of thresholder."""

    mode: ThresholdMode = parameter(ThresholdMode.OTSU_PROPORTIONAL, "how the threshold is chosen", thesis_name="mode")
    fixed_threshold: float = parameter(
        66.0,
        "threshold of mode FIXED",
        unit="echo strength",
        low=0.0,
        high=255.0,
        thesis_name="fixedThresholdValue",
    )
    otsu_multiplier: float = parameter(
        1.4,
        "factor on Otsu's threshold in OTSU+PROPORTIONAL",
        low=0.0,
        high=10.0,
        thesis_name="OTSUMultiplier",
    )
    otsu_nonzero: bool = parameter(True, "give Otsu only the strengths above zero")
    max_proportion: float = parameter(
        0.5,
        "share of the strongest echo in PROPORTIONAL",
        low=0.0,
        high=1.0,
        thesis_name="maxThresholdProportion",
    )
    min_proportion: float = parameter(
        0.5,
        "share of the weakest echo in PROPORTIONAL",
        low=0.0,
        high=1.0,
        thesis_name="minThresholdProportion",
    )
    min_threshold: float = parameter(
        0.0,
        "the threshold is never below this",
        unit="echo strength",
        low=0.0,
        high=255.0,
        thesis_name="minThresholdValue",
    )
    kernel: Kernel = parameter(
        Kernel.NUMPY, "what runs the loops: NUMBA is two to three times faster and needs python3-numba", tunable=False
    )

    def check(self) -> None:
        """Raise ParameterError for a kernel that is not installed."""
        check_kernel("kernel", self.kernel)


class Thresholder:
    """Removes the points whose strength is not above the threshold."""

    def __init__(self, parameters: ThresholderParameters) -> None:
        self.parameters = parameters
        self._loops = strength_loops(parameters.kernel)
        self.newest_threshold: Optional[float] = None
        """The threshold of the newest cloud; None before the first and for a cloud without a finite point."""

    def __call__(self, cloud: IntensityCloud) -> IntensityCloud:
        """Return the cloud's strong points; a cloud without a finite point comes back without points.

        Echoes are what lies above the threshold, as in Otsu's upper class.
        """
        counts = self._loops.count(cloud)
        self.newest_threshold = None if counts.is_empty else self.threshold(counts)
        if self.newest_threshold is None:
            return cloud.take(np.empty(0, dtype=np.int64))
        return cloud.take(self._loops.strong(cloud, self.newest_threshold))

    def threshold(self, counts: StrengthCounts) -> float:
        """Return the threshold of a cloud with a finite point.

        OTSU and OTSU+PROPORTIONAL separate strong echoes from weak ones. Where all strengths above 0 are the same,
        somebody has separated them already (a recording of detections): then their threshold is 0, or min_threshold if
        that is higher, and all of them pass. FIXED and PROPORTIONAL make no such exception.
        """
        parameters = self.parameters
        if parameters.mode is ThresholdMode.FIXED:
            value = parameters.fixed_threshold
        elif parameters.mode is ThresholdMode.PROPORTIONAL:
            value = parameters.max_proportion * counts.highest + parameters.min_proportion * counts.lowest
        elif parameters.mode is ThresholdMode.OTSU:
            value = self._otsu(counts)
        else:
            value = parameters.otsu_multiplier * self._otsu(counts)
        return max(value, parameters.min_threshold)

    def _otsu(self, counts: StrengthCounts) -> float:
        if not counts.echoes_differ:
            return 0.0
        return self._loops.separate(counts.levels if self.parameters.otsu_nonzero else counts.all_levels)
