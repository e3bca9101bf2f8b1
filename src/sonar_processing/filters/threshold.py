"""Keeps the strong echoes (thesis 6.5.3)."""

from dataclasses import dataclass
from enum import Enum
from typing import Optional

import numpy as np

from node_support.parameters import ParameterSet, parameter
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.otsu import otsu_threshold


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


class Thresholder:
    """Removes the points whose strength is not above the threshold."""

    def __init__(self, parameters: ThresholderParameters) -> None:
        self.parameters = parameters
        self.newest_threshold: Optional[float] = None
        """The threshold of the newest cloud; None before the first and for a cloud without a finite point."""

    def __call__(self, cloud: IntensityCloud) -> IntensityCloud:
        """Return the cloud's strong points; a cloud without a finite point comes back without points.

        Echoes are what lies above the threshold, as in Otsu's upper class.
        """
        valid = cloud.valid
        if not valid.any():
            self.newest_threshold = None
            return cloud.select(valid)
        strengths = np.ascontiguousarray(cloud.points[:, 3])
        self.newest_threshold = threshold = self.threshold(strengths if valid.all() else strengths[valid])
        with np.errstate(invalid="ignore"):
            return cloud.select(valid & (strengths > threshold))

    def threshold(self, strengths: np.ndarray) -> float:
        """Return the threshold for `strengths` (n,), n > 0, all finite.

        OTSU and OTSU+PROPORTIONAL separate strong echoes from weak ones. Where all strengths above 0 are the same,
        somebody has separated them already (a recording of detections): then their threshold is 0, or min_threshold if
        that is higher, and all of them pass. FIXED and PROPORTIONAL make no such exception.
        """
        parameters = self.parameters
        if parameters.mode is ThresholdMode.FIXED:
            value = parameters.fixed_threshold
        elif parameters.mode is ThresholdMode.PROPORTIONAL:
            value = parameters.max_proportion * strengths.max() + parameters.min_proportion * strengths.min()
        elif parameters.mode is ThresholdMode.OTSU:
            value = self._otsu(strengths)
        else:
            value = parameters.otsu_multiplier * self._otsu(strengths)
        return max(float(value), parameters.min_threshold)

    def _otsu(self, strengths: np.ndarray) -> float:
        echoes = strengths[strengths > 0]
        if not echoes.size or echoes.min() == echoes.max():
            return 0.0
        return otsu_threshold(echoes if self.parameters.otsu_nonzero else strengths)
