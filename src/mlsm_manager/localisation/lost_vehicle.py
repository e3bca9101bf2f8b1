"""Whether the vehicle's place in a map is known, expected or lost, and the search for it in the whole map."""

from dataclasses import dataclass, replace
from typing import Optional

import numpy as np

from mlsm_manager.localisation.joint_session import belief_of_match
from mlsm_manager.scan_matching.distribution_matcher import relocalised
from mlsm_manager.scan_matching.prediction import OdometryErrors, carried_on
from mlsm_manager.scan_matching.scan import Belief, Matcher, MatchResult, MatchStatus, Scan
from mlsm_manager.scan_matching.scan_path import POSE, POSITION, YAW
from mlsm_manager.surface_map.blocks import BlockSource
from node_support.geometry import wrapped

_SURE = 3.0  # standard deviations by which two places of one vehicle may differ
_SCALE = 0.3  # relative error of distances of an odometry of which no echo has told anything yet
_FARTHEST = 10.0  # m: where the odometry since a scan is less sure, the next one confirms nothing
_MOST_REJECTED = 3  # scans in a row that do not match show that the vehicle is elsewhere
_UNCONFIRMED = "found in the whole map by this scan alone; the next one must be found where that leads to"


@dataclass(frozen=True)
class FoundPlace:
    """Where a scan was found somewhere in the map, when the odometry said T_odom_base (3,)."""

    belief: Belief
    T_odom_base: np.ndarray

    def leads_to(self, later: "FoundPlace", errors: OdometryErrors) -> bool:
        """Return whether the odometry, which errs by `errors`, goes from here to a place that was found later."""
        expected = carried_on(self.belief, self.T_odom_base, later.T_odom_base, later.belief.time, errors)
        difference = (later.belief.theta - expected.theta)[POSE]
        difference[YAW] = wrapped(difference[YAW])
        distance = np.hypot(*(later.T_odom_base - self.T_odom_base)[:2])
        covariance = expected.covariance[POSE, POSE] + (_SCALE * distance) ** 2 * np.diag([1.0, 1.0, 0.0])
        is_known = np.trace(covariance[POSITION, POSITION]) < _FARTHEST**2
        covariance += later.belief.covariance[POSE, POSE]
        return bool(is_known and difference @ np.linalg.solve(covariance, difference) < _SURE**2)


class PlaceSearch:
    """Decides, scan by scan after a map was loaded, whether the place is known, expected or lost.

    may_be_near: whether the vehicle may still be where it is expected, also when the whole map is searched.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Take the place as known."""
        self._left: Optional[int] = None
        self.may_be_near = False
        self._found: Optional[FoundPlace] = None

    def expect(self) -> None:
        """Take the place as near to where it is expected."""
        self._left = _MOST_REJECTED
        self.may_be_near = True

    def lose(self) -> None:
        """Take the place as anywhere in the map."""
        self.forget()
        self._left = 0

    @property
    def is_known(self) -> bool:
        """Whether the place is known: neither expected nor lost."""
        return self._left is None

    @property
    def is_lost(self) -> bool:
        return self._left == 0

    def learn(self, accepted: bool) -> None:
        """Learn whether a scan was matched."""
        if accepted:
            self.forget()
        elif self._left:
            self._left -= 1

    def found(self, scan: Scan, target: BlockSource, matcher: Matcher, errors: OdometryErrors) -> MatchResult:
        """Return where in the whole map a scan was taken; its place holds if the one found before leads there.

        A basin looks alike from both ends: some scans of the end that the map does not have are found at the other, but
        seldom two in a row (`scripts/bench lost`).
        """
        result = relocalised(scan, target, matcher, errors)
        if not result.accepted:
            return result
        found = FoundPlace(belief_of_match(scan, result, errors), scan.reference_pose)
        before, self._found = self._found, found
        if before is not None and before.leads_to(found, errors):
            return result
        return replace(result, status=MatchStatus.AMBIGUOUS, reason=_UNCONFIRMED)
