"""Parameters of the matchers."""

from dataclasses import dataclass

from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.beam_width import beam_width_parameter


@dataclass(frozen=True)
class FixLimits(ParameterSet):
    """What any fix must hold to."""

    min_points: int = parameter(15, "a scan with fewer points on the map is not matched", low=3, high=10000)
    max_position_deviation: float = parameter(
        0.5, "a fix with a greater standard deviation in its least certain direction is rejected",
        unit="m", low=0.001, high=100.0,
    )  # fmt: skip
    max_jump: float = parameter(
        4.0, "greatest distance of a fix from the expected pose, in the prior's standard deviations",
        low=1.0, high=100.0,
    )  # fmt: skip


@dataclass(frozen=True)
class DistributionMatcherParameters(FixLimits):
    """Parameters of the default matcher."""

    search_distance: float = parameter(
        3.5, "greatest distance from the expected position at which a scan is searched", unit="m", low=0.0, high=500.0
    )
    search_angle: float = parameter(
        0.384, "greatest angle from the expected heading at which a scan is searched", unit="rad", low=0.0, high=3.1416
    )
    search_cell: float = parameter(0.5, "step of the search", unit="m", low=0.05, high=10.0)
    candidates: int = parameter(6, "poses that the search passes on to the refinement", low=1, high=100)
    beam_width: float = beam_width_parameter()
    range_scale_deviation: float = parameter(
        0.0,
        "standard deviation of a common relative error of all ranges, as from the speed of sound",
        low=0.0,
        high=0.5,
    )
    max_yaw_deviation: float = parameter(
        0.1, "a fix with a greater standard deviation of the heading is rejected", unit="rad", low=0.001, high=3.1416
    )
    min_gain_over_second: float = parameter(
        3.0,
        "least lead in log-likelihood [nat] of the best pose over the second-best; 0: no check",
        low=0.0,
        high=100.0,
    )
    min_significance: float = parameter(
        5.0,
        "least lead of the matched share of points over that of random poses, in standard deviations",
        low=0.0,
        high=100.0,
    )
    min_agreement: float = parameter(
        0.8, "least share of echoes that the map explains times share of the map that no echo contradicts",
        low=0.0, high=1.0,
    )  # fmt: skip
    max_steps: int = parameter(40, "Gauss-Newton steps from each candidate, at most", low=1, high=1000)


@dataclass(frozen=True)
class SegmentsMatcherParameters(ParameterSet):
    """Parameters of the thesis's matcher."""

    max_iterations: int = parameter(20, "SEGMENTS: iterations at most", low=1, high=1000, thesis_name="maxIterations")
    error_threshold: float = parameter(
        0.3, "SEGMENTS: greatest error of a match that is accepted", unit="m", low=0.0, high=100.0,
        thesis_name="errorThreshold",
    )  # fmt: skip
    n_samples: int = parameter(
        5, "SEGMENTS: places searched in the direction of movement", low=0, high=100, thesis_name="nSamples"
    )
    sample_step: float = parameter(
        0.1, "SEGMENTS: distance of these places, as a share of the estimated movement", low=0.0, high=10.0,
        thesis_name="sampleStep",
    )  # fmt: skip


@dataclass(frozen=True)
class GicpMatcherParameters(FixLimits):
    """Parameters of Open3D's generalised ICP."""

    gicp_distance: float = parameter(
        2.0, "GICP: greatest distance from an echo to its block", unit="m", low=0.01, high=100.0
    )
