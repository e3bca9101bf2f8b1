"""How old the newest fix is, and how well the position is known now that the odometry alone has carried it on."""

from enum import IntEnum
from typing import NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.scan_matching.prediction import Belief, OdometryErrors, predicted
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.scan_matching.scan_path import POSE, POSITION
from mlsm_manager.self_check.path_checks import LARGEST_DEVIATION
from node_support.health import Health, Level
from node_support.timing import UsualInterval


class PositionState(IntEnum):
    """How well a position is known; the numbers and meanings are those of msg/PositionStatus.msg."""

    GOOD = 0
    PROVISIONAL = 1
    DOUBTFUL = 2
    UNKNOWN = 3


class PlaceNow(NamedTuple):
    """age: s since the end of the scan of the newest fix. overdue: s since two more should have come.

    covariance: (3, 3) of x, y and yaw in the map [m, rad], propagated to now by the odometry's errors.
    """

    age: float
    overdue: float
    covariance: np.ndarray

    @property
    def deviation(self) -> float:
        """Root of the sum of both variances of the position, m."""
        return float(np.sqrt(max(np.trace(self.covariance[POSITION, POSITION]), 0.0)))


class FixAge:
    """Remembers the newest fix, and the odometry when the belief was made."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget the fixes, because time jumped or the map is gone."""
        self._fixes = UsualInterval()
        self._fixed_at: Optional[float] = None
        self._believed: Optional[Tuple[float, np.ndarray]] = None

    def learn_fix(self, time: float) -> None:
        """Learn that the scan that ended at `time` [s] was matched."""
        self._fixes.take(time)
        self._fixed_at = time

    def learn_odometry(self, time: float, pose: np.ndarray) -> None:
        """Learn T_odom_base (3,) at the time [s] of the newest belief."""
        self._believed = time, pose

    def place_at(self, time: float, pose: np.ndarray, belief: Belief, errors: OdometryErrors) -> Optional[PlaceNow]:
        """Return what is known at `time` [s], when the odometry says T_odom_base (3,); None before the first fix."""
        if self._fixed_at is None or self._believed is None:
            return None
        covariance = belief.covariance
        if time > belief.time and self._believed[0] == belief.time:
            track = Track(np.array([belief.time, time]), np.array([self._believed[1], pose]))
            covariance = predicted(belief, track, time, errors).covariance
        return PlaceNow(time - self._fixed_at, self._fixes.overdue(time), covariance[POSE, POSE])


def position_state(
    place: Optional[PlaceNow], is_lost: bool, is_provisional: bool, doubts: Sequence[str]
) -> Tuple[PositionState, str]:
    """Return how well the position is known, and that in words.

    place: None before the first fix. doubts: texts of the checks that fire.
    """
    if is_lost:
        return PositionState.UNKNOWN, "position lost: it is searched for in the whole map"
    if place is None:
        return PositionState.UNKNOWN, "no position yet"
    if place.deviation > LARGEST_DEVIATION:
        return PositionState.UNKNOWN, f"position not known, {place.deviation:.1f} m"
    if doubts:
        return PositionState.DOUBTFUL, f"position doubtful: {'; '.join(doubts)}"
    if is_provisional:
        return PositionState.PROVISIONAL, "position provisional: no two scans agree yet"
    late = f", no fix for {place.age:.0f} s" if place.overdue > 0.0 else ""
    return PositionState.GOOD, f"position good, {place.deviation:.1f} m{late}"


def report_place(health: Health, place: PlaceNow) -> None:
    """Show how old and how good the position is; warn after two missed turns, and louder where it is lost."""
    health.show("age of the newest fix [s]", f"{place.age:.1f}")
    health.show("deviation of the position now [m]", f"{place.deviation:.2f}")
    if place.overdue > 0.0:
        detail = f"the newest is {place.age:.0f} s old; does the sonar's head turn, and are echoes heard?"
        health.problem("seconds without a new fix", f"{detail} The position is known to {place.deviation:.1f} m")
    if place.deviation > LARGEST_DEVIATION:
        detail = f"its deviation is {place.deviation:.1f} m, must be at most {LARGEST_DEVIATION:g} m"
        health.problem("seconds in which the position is not known", detail, level=Level.ERROR)
