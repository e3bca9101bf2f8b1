"""A recording mapped: read, corrected, matched, refined, checked, and further recordings added to its map."""

import sys
from argparse import Namespace
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import cycle
from multiprocessing import cpu_count, get_context
from pathlib import Path
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np

from georeferencing.adjustment import Adjusted
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.findings import Findings
from mlsm_manager.offline.heard_scans import (
    Heard,
    heard_in,
    progress_bar,
    with_odometry_mended,
    with_steady_head,
    with_turning_head,
)
from mlsm_manager.offline.odometry_choice import (
    are_moves_turned,
    believed_runs,
    followed,
    is_named,
    odometry_in,
    positions_mislead,
)
from mlsm_manager.offline.recording import Recording, read_recording, scans_of, whole_turns
from mlsm_manager.offline.refinement import REFITS, Refined, parts_of_refining, refine, refitted_verdicts
from mlsm_manager.offline.replay import CORRECTED, Replayed, ReplayParameters, replay
from mlsm_manager.offline.run_files import FURTHER_COLORS, REFINED, Run
from mlsm_manager.offline.suited_parameters import OdometryFound, with_cells
from mlsm_manager.offline.trust import Trust
from mlsm_manager.report.mission import Path as Trajectory
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.self_check.beam_causes import beam_causes, ranges_are_told
from mlsm_manager.self_check.causes import CERTAIN, Assumption, Cause, Fault
from mlsm_manager.self_check.companions import without_companions
from mlsm_manager.self_check.course import NOT_TOLD
from mlsm_manager.self_check.echo_causes import echo_findings, put_right
from mlsm_manager.self_check.motion_findings import assumed_of_lengths
from mlsm_manager.self_check.standing import standing_causes
from mlsm_manager.surface_map.map_file import StoredMap
from recordings.bags.bag import RecordingError
from recordings.reader import Request
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractor

_YAW_AS_TOLD = "the sonar's yaw in tf is right, which a vehicle that strafes with a compass alone does not show"
_MAP_FRAME = "map"  # the frame that live.yaml's nodes call their map by default
_SHOWN_AFTER = 3.0  # s after a scan ends: its correction waits for odometry and is blended in


@dataclass(frozen=True)
class Session:
    """bag: its file. replayed: what came of it in the map of those before, in which the vehicle is searched first."""

    bag: Path
    replayed: Replayed

    def to_mapping(self) -> Dict[str, object]:
        return {
            "bag": self.bag.name,
            "scans": len(self.replayed.updates),
            "matched": self.replayed.matched,
            "rejected": self.replayed.rejected,
            "found_after_scans": self.scans_until_found,
        }

    def trajectory(self, color: str) -> Trajectory:
        """Return the vehicle's path since the first scan was found in the map; empty where none was."""
        found, replayed = self.scans_until_found, self.replayed
        start = np.inf if found is None else replayed.updates[found].scan.reference_time + _SHOWN_AFTER
        known = replayed.times >= start
        return Trajectory(f"{CORRECTED}, {self.bag.name}", color, replayed.times[known], replayed.corrected[known])

    @property
    def scans_until_found(self) -> Optional[int]:
        """Number of scans before the first that was found; None where none was, and nothing was added to the map."""
        accepted = [index for index, update in enumerate(self.replayed.updates) if update.accepted]
        return accepted[0] if accepted else None


@dataclass(frozen=True)
class MappedBag:
    """What was made of a recording and of those added to its map.

    odometry: how the vehicle knows its motion. parameters: those of the run, with the calibration that was found.
    refined and findings are None where nothing was refined, or no solver ran; charted where no origin was asked for.
    """

    title: str
    recording: Recording
    odometry: OdometryFound
    parameters: ReplayParameters
    replayed: Replayed
    refined: Optional[Refined]
    findings: Optional[Findings]
    sessions: List[Session]
    run: Run
    charted: Optional[Adjusted] = None

    @property
    def solution(self) -> Optional[Solution]:
        """The run as the joint solver knows it best; None where it did not follow it."""
        if self.refined is not None:
            return self.refined.motion.run
        return None if self.replayed.solver is None else self.replayed.solver.solution


def mapped_bag(recording: Recording, options: Namespace) -> MappedBag:
    """Map `recording`, and the bags after the first, as the command line says. Raises RecordingError and OSError."""
    recording, causes = with_odometry_mended(recording, options.parameters.part(MotionLimits))
    recording, trembling = with_steady_head(recording)
    recording, standing = with_turning_head(recording)
    recording = recording.corrected(options.parameters.part(BeamCorrection))
    return _mapped(recording, [*causes, *trembling, *standing], odometry_in(recording, options), options)


def _mapped(recording: Recording, causes: List[Cause], odometry: OdometryFound, options: Namespace) -> MappedBag:
    """Map a recording, whose beams are corrected, with an odometry that may be of the kind that was found.

    causes: what was mended so far.
    """
    if odometry.kind is OdometryKind.HEADING and not is_named(options):
        recording = recording.without_positions()
    beams, companions = without_companions(recording.beams, recording.track)
    extractor = EchoExtractor(options.parameters.echoes())
    heard = heard_in(replace(recording, beams=beams), odometry.kind, extractor, options)
    recording, causes = heard.recording, [*causes, *heard.over, *companions]
    extracting = options.parameters.changed(extractor.newest_parameters.to_mapping())
    extracting = with_cells(extracting, heard.scans, options.fixed)
    odometry, parameters, replayed = followed(recording, heard.scans, extracting, odometry, options)
    _tell_of_refused(replayed, options)
    found = echo_findings(heard.scans, recording.sonar_in_base, replayed.corrections)
    if not odometry.put_right.text and are_moves_turned(recording, found.mount, options):
        track, cause, assumed = put_right(recording.track, found.mount)
        known = odometry._replace(put_right=assumed)
        return _mapped(recording.with_track(track), [*causes, *heard.mounted, cause], known, options)
    of_echoes = [*heard.mounted, *found.causes]
    standing = standing_causes(heard.scans, recording.track, replayed.corrected)
    others = [*causes, *beam_causes(recording.sent), *standing]
    refined = _refined(replayed, recording, parameters, found.suspected, [*of_echoes, *others], options)
    runs = believed_runs(replayed, refined)
    if positions_mislead(recording, heard.scans, extracting, odometry, runs, found.mount, options):
        reason = f"{odometry.reason}, but not as the echoes tell: the heading alone is believed"
        cause = Cause("reported positions do not go where the echoes tell", CERTAIN, is_mended=True)
        known = OdometryFound(OdometryKind.HEADING, reason)
        return _mapped(recording, [*causes, *heard.mounted, cause], known, options)
    causes = [*of_echoes, *others] if refined is None else refined.motion.told_with(of_echoes, others)
    return _judged(heard, odometry, parameters, replayed, refined, causes, options)


def _refined(
    replayed: Replayed, recording: Recording, parameters: ReplayParameters, suspected: Sequence[Fault],
    causes: Sequence[Cause], options: Namespace,
) -> Optional[Refined]:  # fmt: skip
    """Return the fit of the whole run, where one is asked for, with faults mended that are suspected, or causes."""
    if not options.refine:
        return None
    suspected = [*suspected, *(cause.fault for cause in causes if cause.fault is not None)]
    with progress_bar(parts_of_refining(replayed.rivals), "part", "refine") as bar:
        are_told, settings = ranges_are_told(recording.sent), parameters.map_settings()
        return refine(replayed, recording.track, settings, suspected, are_told, bar.update)


def _judged(
    heard: Heard, odometry: OdometryFound, parameters: ReplayParameters, replayed: Replayed,
    refined: Optional[Refined], causes: List[Cause], options: Namespace,
) -> MappedBag:  # fmt: skip
    """Return what was made of a recording, checked, and of those added to its map. causes: of what is wrong."""
    further = [heard.signs.turns()]
    if options.check:
        with progress_bar(REFITS, "fit", "check") as bar:
            further += refitted_verdicts(refined.motion.run, refined.motion.fit, bar.update)
    if replayed.rivals is not None and replayed.rivals.told:
        odometry = odometry._replace(reason=f"{odometry.reason}; by the echoes {replayed.rivals.told}")
    findings, known = None, parameters
    if replayed.solver is not None:
        findings = Findings.of(replayed, refined, further, causes, _assumed(odometry, heard.mounted, refined, replayed))
        known = findings.calibration.applied(parameters)
    sessions = _further_sessions(replayed, known, options)
    run = _run(replayed, refined, sessions, known, None if findings is None else findings.trust)
    title = " ".join(bag.name for bag in options.bags)
    return MappedBag(title, heard.recording, odometry, known, replayed, refined, findings, sessions, run)


def _assumed(
    odometry: OdometryFound, mended: Sequence[Cause], refined: Optional[Refined], replayed: Replayed
) -> Assumption:  # fmt: skip
    """Return what the path rests on though no check tells it: of the odometry, or of the sonar's mount."""
    if odometry.assumed.text:
        return odometry.assumed
    if mended:
        return Assumption("the mount is as the echoes tell it, to some degrees; correct tf and map again", 0.0)
    course = NOT_TOLD if refined is None else refined.motion.course
    if odometry.kind is OdometryKind.HOVERING and not course.is_told:
        return Assumption(_YAW_AS_TOLD, 0.0)
    return assumed_of_lengths(replayed.solver.solution) if refined is None else refined.motion.assumed


def _tell_of_refused(replayed: Replayed, options: Namespace) -> None:
    """Say which scans were left out, and where none holds an echo. Raises RecordingError where no scan is left."""
    for reason, count in replayed.refused.items():
        print(f"map_bag: {options.bags[0]}: left out {count} {reason}", file=sys.stderr)
    if not any(map(len, replayed.scans)):
        print(f"map_bag: {options.bags[0]}: the map is empty: no echo stands out of what is heard", file=sys.stderr)
    if not replayed.updates:
        raise RecordingError(f"{options.bags[0]}: not one of {sum(replayed.refused.values())} scans could be used")


def _further_sessions(first: Replayed, parameters: ReplayParameters, options: Namespace) -> List[Session]:
    """Replay all bags but the first, each in the map of those before, with the first one's calibration."""
    bags, sessions = options.bags[1:], []
    if not bags:
        return []
    known = _stored(first, parameters)
    # No fork: this process may have threads that hold locks.
    with ProcessPoolExecutor(min(len(bags), cpu_count()), get_context("spawn")) as executor:
        request = replace(options.request, truth=None)
        waiting = [executor.submit(_prepared, bag, request, parameters) for bag in bags]
        for bag, job in zip(bags, waiting):
            recording, scans = job.result()
            with progress_bar(len(scans), "scan", bag.name[:9]) as bar:
                sessions.append(Session(bag, replay(recording, scans, parameters, bar.update, known)))
            known = _stored(sessions[-1].replayed, parameters)
    return sessions


def _prepared(bag: Path, request: Request, parameters: ReplayParameters) -> Tuple[Recording, List[Scan]]:
    """Return the corrected recording and its scans. Raises RecordingError and OSError."""
    recording = read_recording(bag, request).corrected(parameters.part(BeamCorrection))
    scans = scans_of(recording, EchoExtractor(parameters.echoes()))
    return recording, whole_turns(bag, len(recording.beams), scans)


def _stored(replayed: Replayed, parameters: ReplayParameters) -> StoredMap:
    """Return the map as made when the recording ended: equal runs write equal files."""
    calibration = parameters.part(BeamCorrection).to_mapping()
    return StoredMap(_MAP_FRAME, dict(replayed.estimator.layers), calibration, replayed.times[-1])


def _run(
    replayed: Replayed, refined: Optional[Refined], sessions: List[Session], parameters: ReplayParameters,
    trust: Optional[Trust],
) -> Run:  # fmt: skip
    poses = replayed.poses
    stored = _stored(sessions[-1].replayed if sessions else replayed, parameters)
    if refined is not None:
        poses[REFINED] = refined.poses
        stored = replace(stored, layers=refined.layers)
    counts = {
        "scans": len(replayed.scans),
        "matched": replayed.matched,
        "rejected": replayed.rejected,
        "left_out": dict(replayed.refused),
        "blocks": len(stored.shown),
    }
    paths = [session.trajectory(color) for session, color in zip(sessions, cycle(FURTHER_COLORS))]
    further = [path for path in paths if len(path.times)]
    return Run(replayed.times, poses, counts, stored, trust, further)
