"""Parameters of the joint solver. Every default describes a sensor or a method and gives its reason, none a place."""

from dataclasses import dataclass

from node_support.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class DvlOdometry(ParameterSet):
    """How wrong an odometry of DVL and compass may be.

    A DVL's mounting angle is known to some degrees and its scale to about 1 %; both hardly change during a run. What
    adds up besides is the integrated noise of its velocities. A compass errs by about a degree, and differently where
    iron is near: for some minutes at the speed of a small vehicle.
    """

    position_walk: float = parameter(
        0.12, "random walk of the position: 0.025 m/s that last 12 s", unit="m/sqrt(s)", low=0.001, high=10.0
    )
    direction: float = parameter(0.0, "angle from reported to true motion", unit="rad", low=-3.2, high=3.2)
    direction_deviation: float = parameter(
        0.105, "standard deviation of `direction`: a mounting angle set by eye, 6 deg", unit="rad", low=0.0, high=3.2
    )
    direction_walk: float = parameter(
        0.0014, "random walk of `direction`: 5 deg within an hour", unit="rad/sqrt(s)", low=0.0, high=1.0
    )
    scale: float = parameter(0.0, "true distance over reported distance, minus 1", low=-0.9, high=9.0)
    scale_deviation: float = parameter(0.01, "standard deviation of `scale`: a DVL's data sheet", low=0.0, high=2.0)
    heading_deviation: float = parameter(
        0.01745, "standard deviation of the compass: 1 deg, a data sheet's", unit="rad", low=1e-5, high=3.2
    )
    heading_time: float = parameter(
        300.0, "how long an error of the compass lasts: the time spent near the same iron", unit="s", low=1.0, high=1e6
    )
    heading_walk: float = parameter(
        0.00035, "white noise of the turn rate, besides the compass error", unit="rad/sqrt(s)", low=1e-7, high=1.0
    )


@dataclass(frozen=True)
class SonarCalibration(ParameterSet):
    """What is known of the sonar's ranges and stamps before the run."""

    range_scale: float = parameter(0.0, "true range over reported range, minus 1", low=-0.5, high=1.0)
    range_scale_deviation: float = parameter(
        0.02, "its standard deviation: speed of sound between cold fresh and warm salt water", low=0.0, high=0.5
    )
    sonar_delay: float = parameter(0.0, "seconds by which a beam is later than its stamp", unit="s", low=-5.0, high=5.0)
    sonar_delay_deviation: float = parameter(
        1.0, "its standard deviation: clocks set by hand, stamps taken on arrival", unit="s", low=0.0, high=5.0
    )


@dataclass(frozen=True)
class SurfaceMatching(ParameterSet):
    """How points of one scan are compared with the surfaces that other scans heard."""

    range_deviation: float = parameter(
        0.5,
        "standard deviation of a point square-on to its surface: half an echo's length",
        unit="m",
        low=0.01,
        high=10,
    )
    beam_half_width: float = parameter(
        0.06, "angle within which a beam may have heard a point: twice the half-power half width of common heads",
        unit="rad", low=0.0, high=0.5,
    )  # fmt: skip
    cut: float = parameter(2.2, "points farther apart are not compared", unit="m", low=0.1, high=50.0)
    wide_cut: float = parameter(4.0, "the cut that a new scan starts with", unit="m", low=0.1, high=50.0)
    weight: float = parameter(
        0.1,
        "weight of the comparison of two echoes: neighbours share errors, and an echo meets many scans",
        low=1e-4,
        high=1.0,
    )
    min_cosine: float = parameter(
        0.75, "least cosine between two normals, so that both sides of a wall stay apart", low=-1.0, high=0.99
    )
    block_scans: int = parameter(
        5, "scans that are searched together: about as far as they see the same", low=1, high=50
    )


@dataclass(frozen=True)
class SolverWindow(ParameterSet):
    """What the live solver keeps free and how far it looks."""

    free_nodes: int = parameter(
        40, "newest nodes that may still move: about ten minutes, in which most places are seen from all sides",
        low=2, high=200,
    )  # fmt: skip
    max_frozen_blocks: int = parameter(
        16,
        "older blocks that a scan is compared with, the nearest: 80 scans, more than see one place in a tour",
        low=1,
        high=500,
    )
    lookahead: float = parameter(
        1.0, "seconds of odometry after a scan that are waited for, as beams may be later than stamped", unit="s",
        low=0.0, high=5.0,
    )  # fmt: skip
    live_iterations: int = parameter(3, "Gauss-Newton steps per scan", low=1, high=50)
    batch_iterations: int = parameter(25, "Gauss-Newton steps at most for a whole run", low=1, high=500)
    tolerance: float = parameter(
        0.01, "a step below this in every position ends the iteration", unit="m", low=1e-9, high=1.0
    )


@dataclass(frozen=True)
class MultiViewParameters:
    """All parameters of a run, in groups."""

    odometry: DvlOdometry = DvlOdometry()
    sonar: SonarCalibration = SonarCalibration()
    matching: SurfaceMatching = SurfaceMatching()
    window: SolverWindow = SolverWindow()
