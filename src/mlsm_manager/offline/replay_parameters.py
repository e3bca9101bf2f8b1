"""Parameters of map_bag: those of the echo extractor, the sensor model, the odometry, the matchers and the maps."""

from dataclasses import dataclass

from mlsm_manager.localisation.mapper import Mapper, MapSettings
from mlsm_manager.localisation.matcher_choice import MatcherChoice
from mlsm_manager.localisation.sensor_model import SensorModel
from mlsm_manager.matching.problem.prediction import OdometryErrors
from node_support.parameters import parameter
from sonar_processing.filters.echo_extraction import EchoExtractorParameters

_LIMIT = 10000.0


@dataclass(frozen=True)
class ReplayParameters(MatcherChoice, OdometryErrors, SensorModel, EchoExtractorParameters):
    """All that --set may change; where a default differs from the live nodes', it is what recordings showed."""

    resolution: float = parameter(0.5, "side of a cell of the map that is written", unit="m", low=0.01, high=100.0)
    match_resolution: float = parameter(
        0.5, "side of a cell of the map that scans are matched with", unit="m", low=0.01, high=100.0
    )
    blend_time: float = parameter(1.0, "the correction goes over to a new fix within this time", unit="s", low=0.0)
    range_scale_deviation: float = parameter(
        0.02, "how far all ranges may be off in proportion, as by the speed of sound", low=0.0, high=0.5
    )
    scale_deviation: float = parameter(0.01, "relative error of the distances the odometry reports", low=0.0, high=2.0)
    direction_deviation: float = parameter(
        0.1, "error of their direction, a sensor's mounting angle", unit="rad", low=0.0, high=1.0
    )
    speed_deviation: float = parameter(
        0.025, "error of the speed that does not grow with it", unit="m/s", low=0.0, high=5.0
    )
    turn_rate_deviation: float = parameter(0.0003, "error of the turn rate", unit="rad/s", low=0.0, high=1.0)
    rate_time: float = parameter(12.0, "how long an error of speed or turn rate lasts", unit="s", low=0.1, high=1e6)
    heading_deviation: float = parameter(
        0.0175, "how far the heading may be off at any time, where a compass holds it; 0: it may drift away",
        unit="rad", low=0.0, high=1.0,
    )  # fmt: skip
    max_position_deviation: float = parameter(
        3.0, "a fix whose standard deviation in the worst direction is above this is ambiguous",
        unit="m", low=0.001, high=100.0,
    )  # fmt: skip
    min_agreement: float = parameter(
        0.0, "share of the echoes that the map explains times the share of the map that no echo denies",
        low=0.0, high=1.0,
    )  # fmt: skip
    min_gain_over_second: float = parameter(
        0.0, "log-likelihood by which the best place must beat the second one; 0: not asked", low=0.0, high=100.0
    )
    max_jump: float = parameter(
        6.0, "a pose farther than this from the expected one, in the prior's standard deviations, is rejected",
        low=1.0, high=100.0,
    )  # fmt: skip

    def echoes(self) -> EchoExtractorParameters:
        """Return how echoes are found."""
        return self.part(EchoExtractorParameters)

    def sensor_model(self) -> SensorModel:
        """Return how echoes lie against surfaces."""
        return self.part(SensorModel)

    def build_mapper(self) -> Mapper:
        """Return an empty mapper that matches from the start."""
        settings = MapSettings(self.resolution, self.match_resolution, _LIMIT, 0, self.min_points)
        mapper = Mapper(settings, self.part(OdometryErrors), self.build_matcher())
        mapper.matching = True
        return mapper
