"""Parameters of map_bag: those of the echo extractor, the sensor model and the localiser."""

from dataclasses import dataclass

from mlsm_manager.localisation.parameters import EstimatorName, LocaliserParameters
from node_support.parameters import with_defaults
from recordings.reader import ReadingParameters
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractorParameters


@dataclass(frozen=True)
@with_defaults(
    estimator=EstimatorName.JOINT,
    range_scale_deviation=0.02,
    sonar_delay_deviation=1.0,
    scale_deviation=0.01,
    direction_deviation=0.1,
    speed_deviation=0.025,
    turn_rate_deviation=0.00007,
    rate_correlation_time=12.0,
    motion_correlation_time=10000.0,
    heading_deviation=0.0175,
    max_position_deviation=3.0,
    min_agreement=0.0,
    min_gain_over_second=0.0,
    max_jump=6.0,
)
class ReplayParameters(LocaliserParameters, ReadingParameters, BeamCorrection, EchoExtractorParameters):
    """All that --set may change; where a default differs from the live nodes', it is what recordings showed."""

    def echoes(self) -> EchoExtractorParameters:
        """Return how echoes are found."""
        return self.part(EchoExtractorParameters)
