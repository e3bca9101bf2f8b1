"""Parameters that choose and configure a matcher, for a live vehicle and for a recording."""

from dataclasses import dataclass, fields
from typing import Type, TypeVar

from mlsm_manager.matching.matchers.matcher_table import MATCHERS, Matcher, MatcherName
from mlsm_manager.matching.matchers.parameters import (
    DistributionMatcherParameters,
    GicpMatcherParameters,
    SegmentsMatcherParameters,
)
from node_support.parameters import ParameterSet, parameter

Part = TypeVar("Part", bound=ParameterSet)


@dataclass(frozen=True)
class NamedMatcher(ParameterSet):
    """The matcher by its name."""

    matcher: MatcherName = parameter(
        MatcherName.DISTRIBUTIONS,
        "the default matcher, or for comparison that of the thesis or Open3D's generalised ICP",
        tunable=False,
    )


@dataclass(frozen=True)
class MatcherChoice(GicpMatcherParameters, SegmentsMatcherParameters, DistributionMatcherParameters, NamedMatcher):
    """The choice of a matcher, and the parameters of all matchers."""

    def part(self, kind: Type[Part]) -> Part:
        """Return the parameters of one of the sets that this one is made of."""
        return kind(**{field.name: getattr(self, field.name) for field in fields(kind)})

    def build_matcher(self) -> Matcher:
        """Return the chosen matcher."""
        kind = MATCHERS[self.matcher]
        return kind.build(self.part(kind.parameters))
