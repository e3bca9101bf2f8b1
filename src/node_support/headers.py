"""What a header has to hold before its stamp and frame reach tf2, rospy.Time or a buffer."""

from dataclasses import dataclass
from typing import Any, Iterable

import numpy as np

from node_support.errors import RefusedInput
from node_support.parameters import ParameterSet, parameter

STAMPS_REFUSED = "stamps refused"

DAY = 86400.0  # s: a clock that is wrong by more than a day has never been set
# s: stamps that go back by more mean that time jumped, as when a bag loops; messages overtake each other by less.
JUMP_BACK = 1.0
_NANOSECONDS = 10**9
# tf2 takes stamps as float64 seconds, which may round up, and subtracts and returns them as signed 32 bit numbers;
# from 2^31 s on it ends the process.
_UNSAFE_SECONDS = 2**31 - 1


@dataclass(frozen=True)
class StampParameters(ParameterSet):
    """Which stamps are believed."""

    stamp_tolerance: float = parameter(
        DAY, "refuse messages whose stamps are farther than this from the newest odometry and from the clock",
        unit="s", low=1.0, high=1e9, tunable=False,
    )  # fmt: skip


def stamp_ns(header: Any) -> int:
    """Return the stamp of a header, ns; ROS 1 names its parts secs and nsecs, ROS 2 and rosbags sec and nanosec."""
    stamp = header.stamp
    if hasattr(stamp, "nanosec"):
        return int(stamp.sec) * 10**9 + int(stamp.nanosec)
    return int(stamp.secs) * 10**9 + int(stamp.nsecs)


def check_stamp(stamp_ns: int, references_ns: Iterable[int] = (), tolerance: float = DAY) -> None:
    """Raise RefusedInput unless a stamp [ns] is positive, below 2^31 - 1 s and within `tolerance` [s] of a reference.

    references_ns: what the stamp may be near, the newest odometry and the clock; with none, any safe stamp passes.
    """
    if not 0 < stamp_ns < _UNSAFE_SECONDS * _NANOSECONDS:
        detail = f"{stamp_ns / _NANOSECONDS:.3f} s, must be above 0 and below {_UNSAFE_SECONDS} s; check the publisher"
        raise RefusedInput(STAMPS_REFUSED, detail)
    distances = [abs(stamp_ns - reference) for reference in references_ns]
    if distances and min(distances) > tolerance * _NANOSECONDS:
        raise RefusedInput(
            STAMPS_REFUSED,
            f"{stamp_ns / _NANOSECONDS:.3f} s is {min(distances) / _NANOSECONDS:.0f} s from the newest odometry and "
            f"from the clock, must be at most stamp_tolerance = {tolerance:g} s; set the publisher's clock, or play "
            "bags with --clock and use_sim_time",
        )


def check_point_stamps(stamps: np.ndarray, stamp_ns: int) -> None:
    """Raise RefusedInput unless the times [s] of points, signs left out, are within a day of their cloud's.

    stamps: (n,) float64; those that are not finite belong to points that are left out, and pass.
    """
    distances = np.abs(np.abs(stamps[np.isfinite(stamps)]) - stamp_ns / _NANOSECONDS)
    wrong = np.count_nonzero(distances > DAY)
    if wrong:
        raise RefusedInput(
            STAMPS_REFUSED,
            f"{wrong} of {stamps.size} timeStamps are up to {distances.max():.6g} s from the cloud's stamp, "
            f"must be at most {DAY:g} s; check the publisher",
        )


def check_frame(frame_id: str, kind: str) -> None:
    """Raise RefusedInput, counted as `kind`, for a frame that tf2 cannot take: empty, beginning with / or with NUL."""
    if not frame_id:
        raise RefusedInput(kind, "frame_id is empty; set the publisher's frame")
    if frame_id.startswith("/") or not frame_id.isprintable():
        raise RefusedInput(kind, f"frame_id {frame_id!r}, must be printable and must not begin with /")
