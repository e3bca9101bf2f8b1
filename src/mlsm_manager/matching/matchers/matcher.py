"""The interface of the matchers."""

from typing import Protocol

from mlsm_manager.matching.problem.result import MatchResult, Prior
from mlsm_manager.matching.problem.scan import Scan
from mlsm_manager.surface_map.blocks import Blocks


class Matcher(Protocol):
    """Finds where a scan lies among blocks."""

    def match(self, scan: Scan, target: Blocks, prior: Prior) -> MatchResult:
        """Return where the scan was taken; never raises for a scan or a target that cannot be matched.

        `target` holds the blocks around the vehicle in map; a matcher may leave out those beyond the scan's reach.
        """
