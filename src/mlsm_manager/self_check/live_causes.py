"""What is wrong with a run that goes on: looked for in its newest scans and in the steps of its odometry."""

import threading
from collections import deque
from itertools import takewhile
from typing import Callable, Deque, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import fit_of
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.odometry.faults import FaultKind
from mlsm_manager.odometry.mending import stuck_headings
from mlsm_manager.odometry.steps import Step
from mlsm_manager.scan_matching.scan import Scan, Track, joined
from mlsm_manager.self_check.beam_causes import HeadStood, head_causes, head_stood, of_standing
from mlsm_manager.self_check.causes import (
    NOTHING_ASSUMED,
    UNTOLD_ALONE,
    Assumption,
    Cause,
    Fault,
    of_steps,
    of_stuck,
    ranked,
    widened,
)
from mlsm_manager.self_check.course import NOT_TOLD, CourseFound
from mlsm_manager.self_check.echo_causes import echo_findings
from mlsm_manager.self_check.fault_trials import without_faults
from mlsm_manager.self_check.motion_findings import MotionFindings
from mlsm_manager.self_check.other_places import with_other_places
from mlsm_manager.self_check.standing import standing_causes
from node_support.geometry import composed, move_of
from sonar_processing.beams.beam import Beam

_NOT_JUDGED = "odometry and sonar are not judged"
_NEWEST = 30  # scans that are compared
_FEWEST = 6  # scans: fewer pairs do not show how alike pairs of this water are
_AT_ONCE = 10.0
"""Nats from which on one look is enough. Weaker causes must be found by two in a row: each scan is another chance for a
wrong one."""
_MOST_PLACES = 20000  # four days of scans of 16 s
_BEFORE = 20.0  # s of beams before a scan: whether the head stands is told by some seconds of them
_MOST_BEAMS = 20000  # of the newest scans: 30 of a head that takes 400 steps a turn are 12000


class _Newest(NamedTuple):
    """What is looked at. corrections: T_map_odom at the end of each scan. track: T_odom_base of all.

    places: of all scans so far, the object that a jump of the clock replaces. begin: (2,) m in map, the first of them.
    """

    scans: List[Scan]
    beams: List[Beam]
    corrections: Track
    track: Track
    places: Deque[Tuple[float, float, float]]
    begin: np.ndarray

    @property
    def path(self) -> np.ndarray:
        """T_map_base (n, 3) at the times of `track`."""
        return composed(self.corrections.at(self.track.times), self.track.poses)


class _Found(NamedTuple):
    """What one look finds; see MotionFindings. spread: (2, 2) m^2, what other paths add to the newest place.

    rests_on: what nobody measured, in words; empty where that is nothing.
    """

    causes: List[Cause]
    course: CourseFound
    assumed: Assumption
    spread: np.ndarray = np.zeros((2, 2))
    by_mounts: float = 0.0
    rests_on: str = _NOT_JUDGED


class LiveCauses:
    """Safe to use from several threads: one gives it scans and beams, another looks at them."""

    def __init__(self) -> None:
        self.sonar_in_base = np.zeros(2)
        self._lock = threading.Lock()
        self.clear()

    def clear(self) -> None:
        with self._lock:
            self._scans: Deque[Scan] = deque(maxlen=_NEWEST)
            self._places: Deque[Tuple[float, float, float]] = deque(maxlen=_MOST_PLACES)
            self._corrections: Deque[np.ndarray] = deque(maxlen=_NEWEST)
            self._beams: Deque[Beam] = deque(maxlen=_MOST_BEAMS)
            self._usual_difference, self._is_new = 0.0, False
            self._named: List[Cause] = []
            self._last = _Found([], NOT_TOLD, NOTHING_ASSUMED)
            self._spread, self.by_mounts = np.zeros((2, 2)), 0.0

    @property
    def assumed(self) -> str:
        """What the path rests on though nobody measured it, in words; empty where that is nothing."""
        return self._last.rests_on

    def take(self, scan: Scan, pose: np.ndarray) -> None:
        """Learn a scan, whose odometry does not jump, and T_map_base (3,) at its end."""
        with self._lock:
            self._scans.append(scan)
            self._corrections.append(move_of(scan.reference_pose, pose))
            self._places.append((scan.reference_time, float(pose[0]), float(pose[1])))
            self._is_new = True

    def hear(self, beam: Beam) -> None:
        """Learn a beam, as the head reports it."""
        with self._lock:
            self._beams.append(beam)

    def turned_as_told(self, times: np.ndarray) -> np.ndarray:
        """Return whether the head turned as it reported at `times` (n,) s, at the end of what was heard.

        True where no beam came.
        """
        begin, kept = times.min(initial=np.inf) - _BEFORE, np.ones(len(times), dtype=bool)
        with self._lock:
            beams = list(takewhile(lambda beam: beam.stamp_ns * 1e-9 >= begin, reversed(self._beams)))[::-1]
        for stood in self._head_stood(beams):
            if not stood.is_told:
                kept &= (times < stood.begin) | (times > stood.end)
        return kept

    def look(
        self, newest_run: Callable[[], Optional[Solution]] = lambda: None, steps: Sequence[Step] = ()
    ) -> None:  # fmt: skip
        """Look for causes in the newest scans, if there is one since the last look; takes a second of a core or more.

        newest_run: gives that of these scans, as it is solved; None where no solver follows them. steps: of the
        odometry, which were left out.
        """
        newest = self._taken_since()
        if newest is None:
            return
        of_echoes, _, suspected = echo_findings(newest.scans, self.sonar_in_base, newest.corrections)
        of_beams = [*of_standing(self._head_stood(newest.beams)), *head_causes(newest.beams)]
        of_beams += standing_causes(newest.scans, newest.track, newest.path)
        found = _Found([*of_echoes, *of_beams], self._last.course, self._last.assumed)
        run = newest_run()
        if run is not None:
            # What a stuck compass missed is not tried: the path is not mended live.
            shown = [cause.fault for cause in found.causes if cause.fault is not None]
            shown = [fault for fault in shown if fault.kind is not FaultKind.STUCK]
            # Positions may have gone otherwise beside steps of the compass.
            misread = [one.misread for one in steps if one.misread is not None and one.begin > run.log.node_times[0]]
            motion = _motion_of(run, [*suspected, *shown, *misread], newest, self._last.course)
            spread = motion.spread(run.log.node_times[-1:])[0]
            causes = motion.told_with(of_echoes, of_beams)
            untold = UNTOLD_ALONE if motion.is_alone and motion.is_told else ""
            rests_on = motion.assumed.text or untold
            found = _Found(causes, motion.course, motion.assumed, spread, motion.by_mounts, rests_on)
        stuck = [of_stuck(*one) for one in stuck_headings(newest.track)]
        with self._lock:
            if self._places is newest.places:
                self._learn(found._replace(causes=[*found.causes, *stuck]), newest.scans[0].start)

    def _taken_since(self) -> Optional[_Newest]:
        """Return the newest scans and beams; None where no scan came since they were returned last, or too few."""
        with self._lock:
            if not self._is_new or len(self._scans) < _FEWEST:
                return None
            self._is_new, scans = False, list(self._scans)
            while self._beams and self._beams[0].stamp_ns * 1e-9 < scans[0].start:
                self._beams.popleft()
            corrections = Track(np.array([scan.reference_time for scan in scans]), np.array(self._corrections))
            track = joined([scan.track for scan in scans])
            return _Newest(scans, list(self._beams), corrections, track, self._places, np.array(self._places[0][1:]))

    def _head_stood(self, beams: Sequence[Beam]) -> List[HeadStood]:
        """Return when the head stood, of some beams; if in all of them, earlier ones tell that it turned."""
        stood, usual = head_stood(beams, self._usual_difference)
        with self._lock:
            self._usual_difference = max(self._usual_difference, usual)
        return stood

    def _learn(self, found: _Found, begin: float) -> None:
        """Remember what scans from `begin` [s] on show, and what those before showed: the place is wrong ever after.

        A weak cause is named after two looks in a row have found it.
        """
        self._last, before = found, {cause.kind for cause in self._last.causes}
        named = [cause for cause in found.causes if cause.evidence > _AT_ONCE or cause.kind in before]
        told = {None, *(cause.kind for cause in named)}
        self._named = [*named, *(one for one in self._named if one.begin < begin and one.kind not in told)]
        if not self._named or np.trace(found.spread) > np.trace(self._spread):
            self._spread, self.by_mounts = found.spread, found.by_mounts

    def causes(self, steps: Sequence[Step]) -> List[Cause]:
        """Return what is wrong, ranked; steps: of the odometry, which were left out."""
        return ranked([*of_steps(steps), *self._named])

    def covariance(self, steps: Sequence[Step]) -> np.ndarray:
        """Return what the causes add to the covariance (2, 2) [m^2] of the newest place."""
        with self._lock:
            spread = self._spread
            assumed = [self._last.assumed.if_not] if self._last.assumed.text else []
            if not self._places or not (steps or self._named or assumed):
                return spread
            places = np.array(self._places)
        causes = [*self.causes(steps), *assumed]
        return spread + widened(np.zeros((len(places), 2, 2)), places[:, 0], places[:, 1:], causes)[-1]


def _motion_of(run: Solution, suspected: Sequence[Fault], newest: _Newest, before: CourseFound) -> MotionFindings:
    """Return what speaks against odometry and sonar of a run, and what its course tells of the mount.

    before: what its course told before.
    """
    track = run.log.odometry.track_from(-np.inf)
    motion = with_other_places(without_faults(run, fit_of(run), track, suspected))
    solved, first = track.with_poses(motion.run.path(track.times)), run.log.node_times[:1]
    # A part of a run is solved about its own first place.
    apart = (solved.at(first) - newest.track.with_poses(newest.path).at(first))[0, :2]
    return motion.with_newest_course(solved, newest.begin + apart, before)
