"""What a matcher is, and the table of those there are; a new one is one line here."""

from dataclasses import dataclass
from enum import Enum
from typing import Callable, Dict, Protocol, Type

from mlsm_manager.matching.matchers.distribution_matcher import DistributionMatcher
from mlsm_manager.matching.matchers.gicp_matcher import GicpMatcher
from mlsm_manager.matching.matchers.parameters import (
    DistributionMatcherParameters,
    GicpMatcherParameters,
    SegmentsMatcherParameters,
)
from mlsm_manager.matching.matchers.segments_matcher import SegmentsMatcher
from mlsm_manager.scan_matching.result import MatchResult, Prior
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.blocks import BlockSource
from node_support.parameters import ParameterSet


class Matcher(Protocol):
    """Finds where a scan lies among blocks."""

    def match(self, scan: Scan, target: BlockSource, prior: Prior) -> MatchResult:
        """Return where the scan was taken; never raises for a scan or a target that cannot be matched.

        `target` gives the blocks in map; a matcher fetches those within the scan's reach, or all.
        """


class MatcherName(Enum):
    """Names by which a parameter picks a matcher."""

    DISTRIBUTIONS = "DISTRIBUTIONS"
    SEGMENTS = "SEGMENTS"
    GICP = "GICP"


@dataclass(frozen=True)
class MatcherType:
    """A matcher's parameters and how it is built from them."""

    parameters: Type[ParameterSet]
    build: Callable[[ParameterSet], Matcher]


MATCHERS: Dict[MatcherName, MatcherType] = {
    MatcherName.DISTRIBUTIONS: MatcherType(DistributionMatcherParameters, DistributionMatcher),
    MatcherName.SEGMENTS: MatcherType(SegmentsMatcherParameters, SegmentsMatcher),
    MatcherName.GICP: MatcherType(GicpMatcherParameters, GicpMatcher),
}
