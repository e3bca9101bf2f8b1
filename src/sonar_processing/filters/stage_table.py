"""The table of stages: a stage takes a cloud and returns a cloud. A new filter is one entry here."""

from dataclasses import dataclass, field
from typing import Any, Callable, Dict, Mapping, Optional, Type

from node_support import topics
from node_support.parameters import ParameterSet
from sonar_processing.cloud import Cloud
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.sector_mask import SectorMask, SectorMaskParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters

Stage = Callable[[Cloud], Cloud]
# Silence of a few scans is usual: a vehicle leaves the reach of all walls, or turns its head away.
SCANS_IN_A_ROW = 10


@dataclass(frozen=True)
class StageType:
    """What is known of a stage before it runs.

    outputs: the topic of what it makes of each topic that it takes, relative to the node's namespace.
    figures: what else the stage tells of its newest cloud; each is published as Float32 on ~name and shown in
    /diagnostics, unless it is None.
    when_empty: what to do when it removes every point of scan after scan.
    knows_sonar: `build` gets SonarPoses beside the parameters, which then name `sonar_frame` and `stamp_tolerance`.
    """

    parameters: Type[ParameterSet]
    build: Callable[..., Stage]
    outputs: Mapping[str, str]
    when_empty: str
    figures: Mapping[str, Callable[[Any], Optional[float]]] = field(default_factory=dict)
    knows_sonar: bool = False


STAGES: Dict[str, StageType] = {
    "sector_mask": StageType(
        SectorMaskParameters,
        SectorMask,
        {topics.SCANS: topics.MASKED, topics.POLAR_SCANS: topics.MASKED_POLAR},
        "lower width or reach",
        knows_sonar=True,
    ),
    "thresholder": StageType(
        ThresholderParameters,
        Thresholder,
        {topics.SCANS: topics.THRESHOLDED},
        "lower otsu_multiplier (mode OTSU+PROPORTIONAL), fixed_threshold (FIXED) or max_proportion (PROPORTIONAL), or "
        "raise the sonar's gain",
        {"threshold": lambda stage: stage.newest_threshold},
    ),
    "outlier_remover": StageType(
        OutlierRemoverParameters,
        OutlierRemover,
        {topics.THRESHOLDED: topics.CLEANED},
        "raise stddev_multiplier (mode STATISTICAL), lower min_neighbors (RADIUS), or set mode to NONE",
    ),
    "echo_extractor": StageType(
        EchoExtractorParameters,
        EchoExtractor,
        {topics.POLAR_SCANS: topics.ECHOES},
        "lower min_contrast or min_height, or raise the sonar's gain",
        {"threshold": lambda stage: stage.newest_threshold},
    ),
}


class EmptiedScans:
    """Counts the scans in a row that came with points and left without any."""

    def __init__(self) -> None:
        self._in_a_row = 0

    def take(self, points_in: int, points_out: int) -> bool:
        """Note a scan; return whether it is the last of `SCANS_IN_A_ROW` in a row that lost all their points.

        A scan that comes without points says nothing about the stage and is not counted.
        """
        if not points_in:
            return False
        self._in_a_row = 0 if points_out else self._in_a_row + 1
        return self._in_a_row > 0 and self._in_a_row % SCANS_IN_A_ROW == 0
