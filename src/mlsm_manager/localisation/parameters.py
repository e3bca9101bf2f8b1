"""Parameters of mlsm_core."""

from dataclasses import dataclass
from enum import Enum

from mlsm_manager.localisation.mapper import MapSettings
from mlsm_manager.localisation.matcher_choice import MatcherChoice
from mlsm_manager.matching.problem.prediction import OdometryErrors
from node_support.headers import StampParameters
from node_support.parameters import ParameterError, ParameterSet, parameter

MAX_PREALLOCATED_CELLS = 16_000_000


class MatchInput(Enum):
    """Which points are matched."""

    ECHOES = "ECHOES"
    CLEANED = "CLEANED"


class MapInput(Enum):
    """Which points make the map that is shown and saved."""

    CLEANED = "CLEANED"
    MATCHED = "MATCHED"


@dataclass(frozen=True)
class MatchingParameters(ParameterSet):
    """What is matched, and what becomes of the answers."""

    match_input: MatchInput = parameter(
        MatchInput.ECHOES, "points that are matched: sonar/scan/echoes or sonar/scan/cleaned", tunable=False
    )
    map_input: MapInput = parameter(
        MapInput.CLEANED,
        "points that make the map that is shown and saved: sonar/scan/cleaned, or those that are matched",
        tunable=False,
    )  # fmt: skip
    start_matching: bool = parameter(
        False, "match from the start; afterwards the topic startMatching says it", tunable=False
    )
    match_resolution: float = parameter(
        0.5, "side of a cell of the map that scans are matched with", unit="m", low=0.01, high=100.0, tunable=False
    )
    blend_time: float = parameter(
        1.0, "map -> odom goes over to a new fix within this time", unit="s", low=0.0, high=60.0
    )


@dataclass(frozen=True)
class MapParameters(ParameterSet):
    """The map's grid, its frames and how often it is shown."""

    resolution: float = parameter(
        0.5, "side of a cell", unit="m", low=0.01, high=100.0, tunable=False, thesis_name="resolution"
    )
    size_x_meters: float = parameter(
        120.0, "extent to reserve memory for; the map grows as it must", unit="m", low=0.0, high=100000.0,
        tunable=False, thesis_name="sizeXMeters",
    )  # fmt: skip
    size_y_meters: float = parameter(
        50.0, "extent to reserve memory for; the map grows as it must", unit="m", low=0.0, high=100000.0,
        tunable=False, thesis_name="sizeYMeters",
    )  # fmt: skip
    map_limit: float = parameter(
        10000.0, "points farther than this from the map's origin are left out", unit="m", low=1.0, high=1e6,
        tunable=False,
    )  # fmt: skip
    map_frame: str = parameter("map", "frame of the map", tunable=False)
    odom_frame: str = parameter("odom", "frame of the dead reckoning", tunable=False)
    base_frame: str = parameter("base_link", "frame of the vehicle, which the dead reckoning places", tunable=False)
    transform_rate: float = parameter(
        20.0, "how often map -> odom is sent", unit="1/s", low=0.1, high=1000.0, tunable=False
    )
    transform_tolerance: float = parameter(
        0.1, "how far into the future map -> odom is stamped", unit="s", low=0.0, high=10.0
    )
    map_period: float = parameter(
        1.0, "a changed map is published at most this often, in wall time", unit="s", low=0.05, high=3600.0,
        tunable=False,
    )  # fmt: skip
    save_folder: str = parameter("~/.ros/maps", "the only folder that save_map writes to", tunable=False)

    def check(self) -> None:
        """Refuse an extent that cannot be reserved, and a map that would correct itself."""
        if self.expected_blocks > MAX_PREALLOCATED_CELLS:
            raise ParameterError(
                f"size_x_meters = {self.size_x_meters}, size_y_meters = {self.size_y_meters}: at resolution "
                f"{self.resolution} must make at most {MAX_PREALLOCATED_CELLS} cells"
            )
        if self.map_frame == self.odom_frame:
            raise ParameterError(f"map_frame = {self.map_frame!r}: must differ from odom_frame")

    @property
    def expected_blocks(self) -> int:
        """Cells of the reserved extent."""
        return int(self.size_x_meters / self.resolution) * int(self.size_y_meters / self.resolution)


@dataclass(frozen=True)
class MlsmCoreParameters(MatcherChoice, OdometryErrors, MatchingParameters, MapParameters, StampParameters):
    """All of mlsm_core's parameters, in one namespace."""

    def settings(self) -> MapSettings:
        """Return what the mapper's grids are made from."""
        return MapSettings(
            self.resolution, self.match_resolution, self.map_limit, self.expected_blocks, self.min_points
        )
