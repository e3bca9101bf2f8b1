"""Parameters of the matchers."""

from dataclasses import dataclass

from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.beam_width import beam_width_parameter


@dataclass(frozen=True)
class DistributionMatcherParameters(ParameterSet):
    """Parameters of the default matcher."""

    search_distance: float = parameter(
        3.5, "how far from the expected place a scan is searched, at most", unit="m", low=0.0, high=500.0
    )
    search_angle: float = parameter(
        0.384, "how far from the expected heading a scan is searched, at most", unit="rad", low=0.0, high=3.1416
    )
    search_cell: float = parameter(0.5, "step of the search", unit="m", low=0.05, high=10.0)
    candidates: int = parameter(6, "places that the search hands to the refinement", low=1, high=100)
    beam_width: float = beam_width_parameter()
    range_scale_deviation: float = parameter(
        0.0, "how far all ranges may be off in proportion, as by the speed of sound", low=0.0, high=0.5
    )
    min_points: int = parameter(15, "a scan with fewer points on the map tells nothing", low=3, high=10000)
    max_position_deviation: float = parameter(
        0.5, "a fix whose standard deviation in the worst direction is above this is ambiguous",
        unit="m", low=0.001, high=100.0,
    )  # fmt: skip
    max_yaw_deviation: float = parameter(
        0.1, "a fix whose heading has a standard deviation above this is ambiguous", unit="rad", low=0.001, high=3.1416
    )
    min_gain_over_second: float = parameter(
        3.0, "log-likelihood by which the best place must beat the second one; 0: not asked", low=0.0, high=100.0
    )
    min_significance: float = parameter(
        5.0, "standard deviations by which the matched share must beat what any place would give", low=0.0, high=100.0
    )
    min_agreement: float = parameter(
        0.8, "share of the echoes that the map explains times the share of the map that no echo denies",
        low=0.0, high=1.0,
    )  # fmt: skip
    max_jump: float = parameter(
        4.0, "a pose farther than this from the expected one, in the prior's standard deviations, is rejected",
        low=1.0, high=100.0,
    )  # fmt: skip
    max_steps: int = parameter(40, "steps of Gauss-Newton from each candidate", low=1, high=1000)


@dataclass(frozen=True)
class SegmentsMatcherParameters(ParameterSet):
    """Parameters of the thesis's matcher."""

    max_iterations: int = parameter(20, "segments: iterations at most", low=1, high=1000, thesis_name="maxIterations")
    error_threshold: float = parameter(
        0.3, "segments: with an error at or below this the match holds", unit="m", low=0.0, high=100.0,
        thesis_name="errorThreshold",
    )  # fmt: skip
    n_samples: int = parameter(
        5, "segments: places searched in the direction of movement", low=0, high=100, thesis_name="nSamples"
    )
    sample_step: float = parameter(
        0.1, "segments: distance of these places, as a share of the estimated movement", low=0.0, high=10.0,
        thesis_name="sampleStep",
    )  # fmt: skip
