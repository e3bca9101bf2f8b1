"""What a localiser can be told, also while it runs."""

from dataclasses import dataclass
from enum import Enum

from mlsm_manager.matching.matchers.matcher_table import Matcher


class MapInput(Enum):
    """Which points make the map that is shown and saved."""

    CLEANED = "CLEANED"
    MATCHED = "MATCHED"


@dataclass(frozen=True)
class LocaliserSettings:
    """matcher: for scans near their expected place. anywhere: for a vehicle that is lost.

    blend_time: s, within which the correction goes over to a new one.
    """

    matcher: Matcher
    anywhere: Matcher
    blend_time: float
    map_input: MapInput
