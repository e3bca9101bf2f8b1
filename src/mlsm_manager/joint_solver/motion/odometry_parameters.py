"""How wrong the ways to know a vehicle's motion may be. Every default describes an instrument or a vehicle."""

from dataclasses import dataclass

from node_support.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class Compass(ParameterSet):
    """How wrong the reported heading may be.

    A compass errs by about a degree, and differently where iron is near: for some minutes at the speed of a small
    vehicle.
    """

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
class DvlOdometry(Compass):
    """How wrong an odometry of DVL and compass may be.

    A DVL's mounting angle is known to some degrees and its scale to about 1 %; both hardly change during a run. What
    adds up besides is the integrated noise of its velocities.
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


@dataclass(frozen=True)
class ThrusterOdometry(DvlOdometry):
    """How wrong a motion may be that was reckoned from the commands of the thrusters.

    The speed that a command means is known to a third; it changes with the battery and with what hangs on the vehicle,
    within minutes. A current carries the vehicle along; it is as steady as the water is wide.
    """

    scale_deviation: float = parameter(0.3, "standard deviation of `scale`: speed at a thrust", low=0.0, high=2.0)
    scale_walk: float = parameter(
        0.005, "random walk of `scale`: 10 % within 7 minutes", unit="1/sqrt(s)", low=0.0, high=1.0
    )
    current_deviation: float = parameter(
        0.05, "standard deviation of the current in each direction: sheltered water", unit="m/s", low=0.0, high=5.0
    )
    current_walk: float = parameter(
        0.002, "random walk of the current: 0.05 m/s within ten minutes", unit="m/s/sqrt(s)", low=0.0, high=1.0
    )


@dataclass(frozen=True)
class HeadingOdometry(Compass):
    """What is known of the velocity of a vehicle that reports its heading only.

    It is described in the vehicle's own frame, since a vehicle keeps its speed ahead while it turns. The speed ahead
    changes around a speed of travel, which changes slowly; sideways a vehicle only slips.
    """

    start_speed_deviation: float = parameter(
        0.3, "standard deviation of the speed ahead when the run begins: that of a small vehicle; 0.02 at rest",
        unit="m/s", low=0.0, high=5.0,
    )  # fmt: skip
    speed_deviation: float = parameter(
        0.1, "standard deviation of the speed ahead around the speed of travel", unit="m/s", low=0.001, high=5.0
    )
    speed_time: float = parameter(
        40.0, "how long such a change of speed lasts: a turn, a manoeuvre", unit="s", low=1.0, high=1e5
    )
    travel_walk: float = parameter(
        0.005, "random walk of the speed of travel: 0.1 m/s within 7 minutes", unit="m/s/sqrt(s)", low=0.0, high=1.0
    )
    slip_deviation: float = parameter(
        0.05, "standard deviation of the speed sideways: slip in turns, and current", unit="m/s", low=0.001, high=5.0
    )
    slip_time: float = parameter(20.0, "how long a slip lasts: a turn", unit="s", low=1.0, high=1e5)


@dataclass(frozen=True)
class UnaidedOdometry(HeadingOdometry):
    """What is known of the motion of a vehicle that reports nothing: its turn rate is unknown as well."""

    turn_rate_deviation: float = parameter(
        0.05, "standard deviation of the turn rate: 3 deg/s", unit="rad/s", low=1e-5, high=1.0
    )
    turn_rate_time: float = parameter(10.0, "how long a turn rate lasts: a turn", unit="s", low=1.0, high=1e5)
