"""How old the newest fix is, and how well the position is known now that the odometry alone has carried it on."""

from typing import NamedTuple, Optional, Tuple

import numpy as np

from mlsm_manager.scan_matching.prediction import Belief, OdometryErrors, predicted
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.scan_matching.scan_path import POSITION
from mlsm_manager.self_check.path_checks import LARGEST_DEVIATION
from node_support.health import Health, Level
from node_support.timing import UsualInterval


class PlaceNow(NamedTuple):
    """age: s since the end of the scan of the newest fix. overdue: s since two more should have come.

    deviation: m, root of both variances' sum, propagated to now by the odometry's errors.
    """

    age: float
    overdue: float
    deviation: float


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
        deviation = float(np.sqrt(max(np.trace(covariance[POSITION, POSITION]), 0.0)))
        return PlaceNow(time - self._fixed_at, self._fixes.overdue(time), deviation)


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
