"""How old the newest fix is, how well the position is known now, what speaks against it, and how that is told."""

from enum import IntEnum
from typing import List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.scan_matching.scan_path import POSITION
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.path_checks import LARGEST_DEVIATION
from mlsm_manager.self_check.verdict import FEWEST_MATCHED, Verdict, too_few
from node_support.health import Health, Level

_TOLD = 60.0  # s: so long a fault that was left out is told: some turns of the head, which show the place


class PositionState(IntEnum):
    """How well a position is known; the numbers and meanings are those of msg/PositionStatus.msg."""

    GOOD = 0
    PROVISIONAL = 1
    DOUBTFUL = 2
    UNKNOWN = 3


class PlaceNow(NamedTuple):
    """time: s, of what is told. age: s since the end of the scan of the newest fix. overdue: s since two more should
    have come. covariance: (3, 3) of the pose, propagated to now by the odometry's errors, with what causes add to it.
    fixes: how many there were. by_mounts: m, of the deviation, by the sonar's yaw where nothing tells it: it turns map
    and place alike, so that the place in the map is known.
    """

    time: float
    age: float
    overdue: float
    covariance: np.ndarray
    fixes: int
    by_mounts: float = 0.0

    @property
    def deviation(self) -> float:
        """Root of both variances' sum, m."""
        return float(np.sqrt(max(np.trace(self.covariance[POSITION, POSITION]), 0.0)))

    @property
    def in_map(self) -> float:
        """The deviation of the place in the map, m."""
        return float(np.sqrt(max(self.deviation**2 - self.by_mounts**2, 0.0)))

    @property
    def is_unknown(self) -> bool:
        """Whether the place in the map is known too badly to be told."""
        return self.in_map > LARGEST_DEVIATION


def doubts_of(
    place: Optional[PlaceNow], causes: Sequence[Cause], verdicts: Sequence[Verdict], silent: Mapping[str, float],
    odometry: str,
) -> List[str]:  # fmt: skip
    """Return what speaks against a position, the worst first.

    causes: ranked. silent: seconds for which a topic that is needed did not come; odometry: that of them which is not
    the sonar's.
    """
    parts = (("odometry" if topic == odometry else "sonar", topic, seconds) for topic, seconds in silent.items())
    said = [f"{part} silent for {seconds:.0f} s (nothing on {topic})" for part, topic, seconds in parts]
    if place is not None:
        said = said or ([f"no fix for {place.age:.0f} s"] if place.overdue > 0.0 else [])
        # A fault that was left out is over once scans show the place again.
        recent = [cause for cause in causes if not (cause.is_mended and place.time - cause.begin > _TOLD)]
        said += [_clause(cause, place.time) for cause in recent]
    return said + [verdict.text for verdict in verdicts if verdict.fires]


def position_state(
    place: Optional[PlaceNow], is_lost: bool, is_provisional: bool, doubts: Sequence[str], assumed: str
) -> Tuple[PositionState, str]:
    """Return how well the position is known, and that in words.

    place: None before the first fix. doubts: see `doubts_of`. assumed: on what a good one rests though nobody measured
    it, if anything.
    """
    if is_lost:
        return PositionState.UNKNOWN, "position lost: it is searched for in the whole map"
    if place is None:
        return PositionState.UNKNOWN, "; ".join(["no position yet", *doubts[:1]])
    if place.is_unknown:
        return PositionState.UNKNOWN, "; ".join([f"position not known, {place.in_map:.1f} m", *doubts[:1]])
    known_to = f"{place.deviation:.1f} m"
    if place.by_mounts > place.in_map:  # most of it is the doubt how the map is turned
        known_to += f" ({place.in_map:.1f} m in the map)"
    if doubts:
        return PositionState.DOUBTFUL, f"position doubtful, {known_to}: {'; '.join(doubts)}"
    if is_provisional:
        return PositionState.PROVISIONAL, "position provisional: no two scans agree yet"
    if too_few(place.fixes):
        return PositionState.PROVISIONAL, f"position provisional, {known_to}: {too_few(place.fixes)}"
    return PositionState.GOOD, "; ".join(filter(None, [f"position good, {known_to}", assumed]))


def _clause(cause: Cause, time: float) -> str:
    return cause.text.rstrip(",") if np.isnan(cause.begin) else f"{cause.text} {time - cause.begin:.0f} s ago"


def report_place(health: Health, place: PlaceNow) -> None:
    """Show how old and how good the position is; warn after two missed turns, and louder where it is lost.

    The first fixes leave the odometry's errors open: until they are known, an unknown position is no problem.
    """
    health.show("age of the newest fix [s]", f"{place.age:.1f}")
    health.show("deviation of the position now [m]", f"{place.deviation:.2f}")
    if place.overdue > 0.0:
        detail = f"the newest is {place.age:.0f} s old; does the sonar's head turn, and are echoes heard?"
        health.problem("seconds without a new fix", f"{detail} The position is known to {place.deviation:.1f} m")
    if place.is_unknown and place.fixes >= FEWEST_MATCHED:
        detail = f"its deviation in the map is {place.in_map:.1f} m, must be at most {LARGEST_DEVIATION:g} m"
        health.problem("seconds in which the position is not known", detail, level=Level.ERROR)
