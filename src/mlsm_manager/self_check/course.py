"""Whether a vehicle goes where it looks: if it does not, the sonar or the heading may be turned against it."""

from typing import List, NamedTuple

import numpy as np

from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.causes import Cause
from node_support.geometry import bearings_of, rotated, wrapped

_SECONDS, _GONE = 10.0, 1.0  # s of a stretch, and m in it from which on it has a direction
_FEWEST = 10  # stretches
_AHEAD = np.radians(2.5)  # by which the direction differs in which vehicles are said to go ahead
_STRAFES, _MOSTLY = np.radians(30.0), 0.9  # so many stretches are less far aside where there is a usual course
# The same by a compass alone: where a sonar is turned by 65 to 90 deg, 15 % of a marina's stretches are too slow to be
# put right, as such a vehicle is expected to go ahead.
MOSTLY_ALONE = 0.75
_VAGUE = np.radians(5.0)  # deviation of the mean course: sonar and DVL are mounted by eye to 6 deg; a marina's: 4.8 deg
_CLEAR = 10.0  # deviations: so large a turn is told however vague it is
_ASIDE = 0.5  # share of the course that the echoes may not agree to: the odometry's direction errs besides
_AGREES = 2.0  # deviations from which on a course may be the odometry's
NAMED, NAMED_LIVE = 2.0, 3.0
"""Deviations from which on a turn is named. Live each scan looks for it; an unbroken marina showed 7 +- 3 deg."""
_FAR = 3.0  # deviations: what goes farther aside counts as far
LARGEST = np.radians(45.0)  # a vehicle that goes farther aside strafes, or goes back


class CourseFound(NamedTuple):
    """turn: rad, counter-clockwise, of the sonar against the vehicle. deviation: rad, infinite where none is told.

    strafes: whether the vehicle was seen to have no usual course; the turn is that of its middle one then.
    """

    turn: float
    deviation: float
    strafes: bool = False

    @property
    def is_told(self) -> bool:
        return bool(np.isfinite(self.deviation))

    @property
    def size(self) -> float:
        """The turn in deviations."""
        return abs(self.turn) / self.deviation

    @property
    def unexplained(self) -> float:
        """What the deviation does not explain of the turn, rad."""
        return float(np.sqrt(max(self.turn**2 - self.deviation**2, 0.0)))

    def after(self, before: "CourseFound") -> "CourseFound":
        """Return what is known of the mount if so much was known `before`.

        That holds until another turn is told, or the vehicle is seen to have no usual course: it does not become right
        because the newest way is vague.
        """
        return before if before.is_told and not (self.is_told or self.strafes) else self


NOT_TOLD = CourseFound(0.0, np.inf)  # of a vehicle that was not seen for long enough


def course_of(path: Track, largest: float = LARGEST, mostly: float = _MOSTLY) -> CourseFound:
    """Return what a path T_map_base tells of the sonar's turn, if the vehicle usually goes ahead; needs the past only.

    largest: rad, beyond which it tells nothing. mostly: share of its stretches that go about as usual.

    Echoes tell the motion against the sonar. A vehicle that seems to go to the right, however its odometry's own
    sensor is mounted, has a sonar that is turned to the left.
    """
    times = np.arange(path.times[0], path.times[-1], _SECONDS)
    poses = path.at(times)
    moves = rotated(np.diff(poses[:, :2], axis=0), -(poses[:-1, 2] + poses[1:, 2]) / 2.0)
    moves = moves[np.hypot(*moves.T) > _GONE]
    if len(moves) < _FEWEST:
        return NOT_TOLD
    angles = bearings_of(moves)
    middle = float(np.angle(np.exp(1j * angles).sum()))
    middle = float(wrapped(middle + np.median(wrapped(angles - middle))))
    aside = wrapped(angles - middle)
    spread = 1.48 * float(np.median(np.abs(aside)))
    # A vehicle that slips goes on to do so: in a marina neighbours correlate by .6 to .7, others hardly, and tell less.
    usual = np.clip(aside, -_FAR * spread, _FAR * spread)
    alike = float((usual[1:] * usual[:-1]).mean() / max((usual**2).mean(), np.finfo(float).tiny))
    independent = len(aside) / (1.0 + 2.0 * max(alike, 0.0))
    deviation = np.hypot(1.25 * spread / np.sqrt(independent), _AHEAD)
    # A vehicle that strafes may go one way for half of its time, and the median tells only that.
    strafes = bool(np.quantile(np.abs(aside), mostly) > _STRAFES or abs(middle) > largest)
    is_clear = deviation <= _VAGUE or abs(middle) > _CLEAR * deviation
    return CourseFound(-middle, float(deviation) if is_clear and not strafes else np.inf, strafes)


def moves_are_turned(reported: Track, turn: float) -> bool:
    """Return whether a sonar that seems turned by `turn` [rad] is not, but the moves of the odometry are.

    So it is if these go aside, by the odometry itself, about as far: most vehicles go where their heading points.
    """
    course = course_of(reported, np.pi)
    return course.is_told and bool(abs(wrapped(course.turn + turn)) < _ASIDE * abs(course.turn))


def odometry_agrees(found: CourseFound, reported: Track) -> bool:
    """Return whether an unusual course is about that of the odometry, too.

    Then the vehicle strafes: that sonar and DVL are both turned by the same angle is less likely.
    """
    turn = course_of(reported).turn
    return found.size >= _AGREES and bool(abs(wrapped(found.turn - turn)) < _ASIDE * abs(turn))


def course_causes(found: CourseFound, named: float) -> List[Cause]:
    """Return that the sonar is turned, where it is by at least so many deviations."""
    if found.size < named:
        return []
    angle = f"{np.degrees(found.turn):.0f} +- {np.degrees(found.deviation):.0f} deg"
    text = f"the sonar is turned by {angle} against tf, if the vehicle usually goes where its heading points"
    return [Cause(text, 0.5 * found.size**2)]
