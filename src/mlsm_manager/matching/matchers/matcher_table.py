"""The table of matchers; a new one is one line here."""

from dataclasses import dataclass
from enum import Enum
from typing import Callable, Dict, Type

from mlsm_manager.matching.matchers.distribution_matcher import DistributionMatcher
from mlsm_manager.matching.matchers.matcher import Matcher
from mlsm_manager.matching.matchers.parameters import DistributionMatcherParameters, SegmentsMatcherParameters
from mlsm_manager.matching.matchers.segments_matcher import SegmentsMatcher
from node_support.parameters import ParameterSet


class MatcherName(Enum):
    """Names by which a parameter picks a matcher."""

    DISTRIBUTIONS = "DISTRIBUTIONS"
    SEGMENTS = "SEGMENTS"


@dataclass(frozen=True)
class MatcherType:
    """A matcher's parameters and how it is built from them."""

    parameters: Type[ParameterSet]
    build: Callable[[ParameterSet], Matcher]


MATCHERS: Dict[MatcherName, MatcherType] = {
    MatcherName.DISTRIBUTIONS: MatcherType(DistributionMatcherParameters, DistributionMatcher),
    MatcherName.SEGMENTS: MatcherType(SegmentsMatcherParameters, SegmentsMatcher),
}
