"""Parameters that choose and configure a matcher, for a live vehicle and for a recording."""

from dataclasses import dataclass, fields
from typing import Type, TypeVar

from mlsm_manager.localisation.sensor_model import BeamEdge
from mlsm_manager.matching.matchers.matcher_table import MATCHERS, Matcher, MatcherName
from mlsm_manager.matching.matchers.parameters import (
    DistributionMatcherParameters,
    GicpMatcherParameters,
    SegmentsMatcherParameters,
)
from node_support.parameters import ParameterSet, parameter

Part = TypeVar("Part", bound=ParameterSet)
Self = TypeVar("Self", bound="MatcherChoice")


@dataclass(frozen=True)
class NamedMatcher(ParameterSet):
    """The matcher by its name."""

    matcher: MatcherName = parameter(
        MatcherName.DISTRIBUTIONS,
        "the default matcher, or for comparison that of the thesis or Open3D's generalised ICP",
        tunable=False,
    )


@dataclass(frozen=True)
class MatcherChoice(
    GicpMatcherParameters, SegmentsMatcherParameters, DistributionMatcherParameters, BeamEdge, NamedMatcher
):
    """The choice of a matcher, and the parameters of all matchers."""

    def part(self, kind: Type[Part]) -> Part:
        """Return the parameters of one of the sets that this one is made of."""
        return kind(**{field.name: getattr(self, field.name) for field in fields(kind)})

    def with_effective_beam_width(self: Self) -> Self:
        """Return these parameters with a beam that is at least as wide as its edges."""
        return self.changed({"beam_width": max(self.beam_width, 2.0 * self.edge_half_width)})

    def for_few_scans(self: Self) -> Self:
        """Return these parameters for a map of a few scans, which lacks much of what another scan sees there."""
        return self.changed({"min_agreement": 0.0, "min_gain_over_second": 0.0})

    def build_matcher(self) -> Matcher:
        """Return the chosen matcher with the effective width of the beam."""
        kind = MATCHERS[self.matcher]
        return kind.build(self.with_effective_beam_width().part(kind.parameters))
