"""The matchers that figures compare, with default parameters."""

from enum import Enum
from typing import Callable, Dict

from benchmarks.gicp_matcher import GicpMatcher, GicpMatcherParameters
from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.result import Matcher
from mlsm_manager.thesis_matching.thesis_matcher import ThesisMatcher, ThesisMatcherParameters


class MatcherName(Enum):
    """Their names in tables."""

    DISTRIBUTIONS = "DISTRIBUTIONS"
    THESIS = "THESIS"
    GICP = "GICP"


MATCHERS: Dict[MatcherName, Callable[[], Matcher]] = {
    MatcherName.DISTRIBUTIONS: lambda: DistributionMatcher(DistributionMatcherParameters()),
    MatcherName.THESIS: lambda: ThesisMatcher(ThesisMatcherParameters()),
    MatcherName.GICP: lambda: GicpMatcher(GicpMatcherParameters()),
}
