"""What the echoes of a whole run say against its odometry and its sonar, and the run with that mended."""

from dataclasses import dataclass, field, replace
from typing import List, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult
from mlsm_manager.joint_solver.motion_models import DIRECTION, SCALE
from mlsm_manager.joint_solver.normal_equations import HELD_DEVIATION, RANGE_SCALE
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.sonar_trials import SonarFault
from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.causes import NOTHING_ASSUMED, Assumption, Cause, is_same, unsure_length
from mlsm_manager.self_check.course import (
    MOSTLY_ALONE,
    NAMED,
    NAMED_LIVE,
    NOT_TOLD,
    CourseFound,
    course_causes,
    course_of,
    odometry_agrees,
)
from mlsm_manager.self_check.delays import late_cause
from mlsm_manager.self_check.echo_causes import turn_text
from mlsm_manager.self_check.scan_pairs import Hypothesis
from node_support.geometry import move_of, rotated, transformed

_UNLIKELY = 3.0  # deviations of what was known before the run of direction and delay, as of its calibration
_UNLIKELY_DELAY = 2.5
_SHORTEST = 0.05  # true over reported distances: a fit of what makes no sense may go back, and tells no length
_ODD_LENGTH = np.log(1.2)  # a sonar's ranges and a DVL's distances are right to some percent
_UNLIKELY_LENGTH = np.log(1.7)  # thrusters err by a third; sonars set to half or twice the range, and feet, by more
_ODD_RANGES = 1.0  # deviations of what was known of the ranges: beyond, a DVL's distances are wrong as often as these


@dataclass(frozen=True)
class MotionFindings:
    """The run as it is known once its odometry is doubted.

    run: fitted as `fit` says, which belongs to the odometry `track`. causes: of what is wrong with the reported one, or
    with the sonar. apart: (n, 2) m each, how far other paths that the run may have gone lie beside this one at its
    nodes. course: how the sonar is turned by the vehicle's usual one. mounts: rad, by how much it may be where none
    tells it. by_mounts: m, how far that turns the newest place about the place where the run began. assumed: which
    lengths are right, where those of sonar and odometry contradict each other and no cause says so.
    """

    run: Solution
    fit: BatchResult
    track: Track
    causes: List[Cause] = field(default_factory=list)
    apart: List[np.ndarray] = field(default_factory=list)
    course: CourseFound = NOT_TOLD
    mounts: float = 0.0
    by_mounts: float = 0.0
    assumed: Assumption = NOTHING_ASSUMED

    @property
    def is_alone(self) -> bool:
        """Whether a compass tells the motion alone."""
        return bool(np.isinf(self.run.parameters.odometry.distance_deviation))

    @property
    def is_told(self) -> bool:
        """Whether the odometry says anything of the motion."""
        return bool(np.ptp(self.track.poses, axis=0).any())

    def spread(self, times: np.ndarray) -> np.ndarray:
        """Return what these paths add to the covariances of the position at `times` (k,) [s], (k, 2, 2) m^2."""
        added = np.zeros((len(times), 2, 2))
        for one in self.apart:
            beside = np.stack([np.interp(times, self.fit.node_times, axis) for axis in one.T], axis=-1)
            added += np.einsum("na,nb->nab", beside, beside)
        return added

    def with_course(self, path: Track) -> "MotionFindings":
        """Return the findings of a whole run with what its path T_map_base says of the sonar's mount."""
        if not self.is_told:
            return self
        return self._with(self._course_of(path), NAMED, self.run.places[0], True, assumed_of_lengths(self.run))

    def with_newest_course(self, path: Track, begin: np.ndarray, before: CourseFound) -> "MotionFindings":
        """Return the findings of the newest scans likewise.

        begin: (2,) m, where these would put the place from which the vehicle was followed. before: what older scans
        told of the mount. Before a course could be looked for, a turn that the odometry may hide is not added.
        """
        if not self.is_told:
            return self
        course = self._course_of(path).after(before)
        # That thrusters err is usual: a run that goes on is not made unsure by it.
        return self._with(course, NAMED_LIVE, begin, course != NOT_TOLD, assumed_of_distances(self.run))

    def _with(
        self, course: CourseFound, named: float, begin: np.ndarray, may_hide: bool, assumed: Assumption
    ) -> "MotionFindings":  # fmt: skip
        """named: deviations from which on a turn is named. begin: (2,) m, about which a turn of the sonar turns places.

        may_hide: whether the odometry hides some of that turn, where no course tells which is turned. assumed: of
        lengths, unless a cause says that these are wrong.
        """
        places, direction = self.run.places, NOT_TOLD if course.is_told else self._direction
        turn, mounts = course.unexplained, 0.0
        if direction.is_told:
            # The DVL's own turn may hide more.
            hidden = float(np.hypot(direction.turn, direction.deviation))
            turn, mounts = (hidden, hidden) if may_hide else (direction.turn, 0.0)
        gone = places - begin
        aside = rotated(gone, np.full(len(gone), turn)) - gone
        causes = [*self.causes, *(course_causes(course, named) or self._calibration_causes())]
        return replace(
            self, causes=causes, apart=[*self.apart, aside, self._late(places)], course=course, mounts=mounts,
            by_mounts=mounts * float(np.hypot(*gone[-1])),
            assumed=self.assumed if any(cause.length for cause in causes) else assumed,
        )  # fmt: skip

    def _course_of(self, path: Track) -> CourseFound:
        if self.is_alone:  # nothing else tells a turn of the sonar, however large it is
            return course_of(path, np.pi, MOSTLY_ALONE)
        course = course_of(path)
        return course._replace(deviation=np.inf, strafes=True) if odometry_agrees(course, self.track) else course

    def _late(self, places: np.ndarray) -> np.ndarray:
        """Return how far nodes at `places` (n, 2) [m] lie beside where they are by the sonar's clock, (n, 2) m.

        Zeros where both clocks agree as usual; where not, nothing tells which of them is right.
        """
        delay, deviation = self._delay
        times = self.fit.node_times + (delay if abs(delay) > deviation else 0.0)
        return np.stack([np.interp(times, self.fit.node_times, axis) for axis in places.T], axis=-1) - places

    @property
    def _delay(self) -> Tuple[float, float]:
        """By how much beams are later than was known before the run, and the deviation of that [s]."""
        (_, delay), (_, deviation) = self.run.state.run, self.run.parameters.run_deviations(self.run.log)
        _, known = self.run.parameters.run_mean(self.run.log)
        return float(delay - known), max(float(deviation), HELD_DEVIATION)

    @property
    def _direction(self) -> CourseFound:
        """By how much the sonar is turned if not the odometry is, whose direction of motion the run found."""
        model = self.run.parameters.odometry
        if DIRECTION not in model.calibrated.values():
            return NOT_TOLD
        turn = float(self.run.state.nodes[-1, DIRECTION] - model.first_node()[DIRECTION])
        return CourseFound(-turn, float(model.first_deviations()[DIRECTION]))

    def _calibration_causes(self) -> List[Cause]:
        """Return what is unlikely of the lengths, the direction and the delay that the run found.

        Where distances and ranges contradict each other, nothing in a run tells which are wrong.
        """
        found, direction, length = [], self._direction, _odometry_length(self.run)
        if abs(length) > _UNLIKELY_LENGTH:
            size = length / self.run.parameters.odometry.distance_deviation
            text = MotionFault(FaultKind.LENGTH, np.nan, (length,)).text
            found.append(Cause(text, 0.5 * size**2, length=unsure_length(length)))
        delay, deviation = self._delay
        size = abs(delay) / deviation
        if size > _UNLIKELY_DELAY:
            found.append(late_cause(delay, 0.5 * size**2))
        if direction.size > _UNLIKELY:
            text = turn_text(Hypothesis(turn=direction.turn))
            found.append(Cause(text, 0.5 * direction.size**2, turn=abs(direction.turn)))
        return found

    def told_with(self, of_echoes: Sequence[Cause], others: Sequence[Cause]) -> List[Cause]:
        """Return the causes with those that pairs of scans show, and others: those that the fit mends it tells better.

        A wrong mount or wrong stamps explain what the fit finds wrong with the odometry.
        """
        if any(cause.fault is None for cause in of_echoes):
            return [*of_echoes, *others]
        faults = [cause.fault for cause in self.causes if cause.fault is not None]
        told = self.causes or of_echoes
        return [*told, *(cause for cause in others if not any(is_same(cause.fault, one) for one in faults))]

    def placed(self, scan: Scan, reported: Track, sonar_in_base: np.ndarray) -> Scan:
        """Return a scan that was placed by `reported` and `sonar_in_base` (2,) [m] as this run places it."""
        for fault in (cause.fault for cause in self.causes):
            if isinstance(fault, SonarFault):
                scan, sonar_in_base = fault.placed(scan, sonar_in_base), fault.sonar_in_base(sonar_in_base)
        if self.track is reported:
            return scan
        moves = move_of(reported.at(scan.times), self.track.at(scan.times))
        return replace(scan, points=transformed(moves, scan.points), track=self.track)


def assumed_of_lengths(run: Solution) -> Assumption:
    """Return which of both a run took for right, where they contradict each other clearly.

    Nobody knows the odometry of a run whose model has a rival.
    """
    length = _odometry_length(run)
    if abs(length) < _ODD_LENGTH or run.parameters.odometry.rival is None:
        return assumed_of_distances(run)
    text = f"the sonar's ranges are right, although the odometry's distances are {np.exp(-length):.2f} times as long"
    return Assumption(f"{text} (name the odometry to decide)", 0.0, unsure_length(length))


def assumed_of_distances(run: Solution) -> Assumption:
    """Return that a run took its odometry's distances for right, where the ranges contradict them clearly."""
    found, expected = (1.0 + values[RANGE_SCALE] for values in (run.state.run, run.parameters.run_mean(run.log)))
    usual = max(run.parameters.run_deviations(run.log)[RANGE_SCALE], HELD_DEVIATION)
    ranges = float(np.log(max(found, _SHORTEST) / expected))
    if abs(ranges) <= _ODD_RANGES * usual:
        return NOTHING_ASSUMED
    text = f"the odometry's distances are right, although the sonar's ranges are {np.exp(-ranges):.2f} times as long"
    return Assumption(f"{text} (measure a known distance to decide)", 0.0, unsure_length(ranges))


def _odometry_length(run: Solution) -> float:
    """Return the logarithm of true distances over reported ones, as a run found it; zero where it tells none."""
    model = run.parameters.odometry
    if SCALE not in model.calibrated.values():
        return 0.0
    found, expected = (1.0 + node[SCALE] for node in (run.state.nodes[-1], model.first_node()))
    return float(np.log(found / expected)) if found > _SHORTEST else 0.0
