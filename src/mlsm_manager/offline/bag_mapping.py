"""A recording mapped: read, corrected, matched, refined, checked, and further recordings added to its map."""

import sys
from argparse import Namespace
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import cycle
from multiprocessing import cpu_count, get_context
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from tqdm import tqdm

from georeferencing.adjustment import Adjusted
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.sonar_trials import SonarFault
from mlsm_manager.localisation.odometry_profiles import COMPASS_ONLY, OdometryKind, strafes
from mlsm_manager.odometry.faults import Mirror
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.findings import Findings
from mlsm_manager.offline.mended_recording import with_odometry_mended, with_steady_head, with_turning_head
from mlsm_manager.offline.recording import Recording, scans_of, whole_turns
from mlsm_manager.offline.refinement import REFITS, Refined, parts_of_refining, refine, refitted_verdicts
from mlsm_manager.offline.replay import Replayed, ReplayParameters, replay
from mlsm_manager.offline.run_files import FURTHER_COLORS, REFINED, Run
from mlsm_manager.offline.sessions import Session, prepared
from mlsm_manager.offline.suited_parameters import (
    OdometryFound,
    goes_astray,
    goes_on_better,
    may_strafe,
    odometry_of,
    with_cells,
    with_odometry,
)
from mlsm_manager.offline.trust import Trust
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.self_check.beam_causes import beam_causes, ranges_are_told
from mlsm_manager.self_check.causes import CERTAIN, Assumption, Cause, Fault, Suspicion
from mlsm_manager.self_check.companions import without_companions
from mlsm_manager.self_check.course import NOT_TOLD, moves_are_turned
from mlsm_manager.self_check.echo_causes import TURN_DEVIATION, EchoFindings, echo_findings, put_right, turn_text
from mlsm_manager.self_check.fault_trials import with_other_ranges
from mlsm_manager.self_check.hypotheses import AS_TOLD, Hypothesis
from mlsm_manager.self_check.lengths import assumed_of_lengths
from mlsm_manager.self_check.north_east_down import ZDownSigns, z_down_signs
from mlsm_manager.self_check.standing import standing_causes
from mlsm_manager.surface_map.map_file import StoredMap
from recordings.bags.bag import RecordingError
from recordings.motion.vehicle_motion import MotionSource
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractor

_YAW_AS_TOLD = "the sonar's yaw in tf is right, which a vehicle that strafes with a compass alone does not show"
_OVER = Cause(turn_text(Hypothesis(is_over=True)), CERTAIN, turn=np.pi)  # if it is the odometry, the path is mirrored
_MAP_FRAME = "map"  # the frame that live.yaml's nodes call their map by default


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
            return self.refined.solution
        return None if self.replayed.solver is None else self.replayed.solver.solution


def mapped_bag(recording: Recording, options: Namespace) -> MappedBag:
    """Map `recording`, and the bags after the first, as the command line says. Raises RecordingError and OSError."""
    recording, causes = with_odometry_mended(recording, options.parameters.part(MotionLimits))
    recording, trembling = with_steady_head(recording)
    recording, standing = with_turning_head(recording)
    recording = recording.corrected(options.parameters.part(BeamCorrection))
    return _mapped(recording, [*causes, *trembling, *standing], _odometry(recording, options), options)


def _mapped(recording: Recording, causes: List[Cause], odometry: OdometryFound, options: Namespace) -> MappedBag:
    """Map a recording, whose beams are corrected, with an odometry that may be of the kind that was found.

    causes: what was mended so far.
    """
    if odometry.kind is OdometryKind.HEADING and not _is_named(options):
        recording = recording.without_positions()
    beams, companions = without_companions(recording.beams, recording.track)
    extractor = EchoExtractor(options.parameters.echoes())
    heard = _heard(replace(recording, beams=beams), odometry, extractor, options)
    recording, causes = heard.recording, [*causes, *heard.over, *companions]
    extracting = options.parameters.changed(extractor.newest_parameters.to_mapping())
    extracting = with_cells(extracting, heard.scans, options.fixed)
    odometry, parameters, replayed = _followed(recording, heard.scans, extracting, odometry, options)
    _tell_of_refused(replayed, options)
    found = echo_findings(heard.scans, recording.sonar_in_base, replayed.corrections)
    if not odometry.put_right.text and _moves_are_turned(recording, found.mount, options):
        track, cause, assumed = put_right(recording.track, found.mount)
        known = odometry._replace(put_right=assumed)
        return _mapped(recording.with_track(track), [*causes, *heard.mounted, cause], known, options)
    of_echoes = [*heard.mounted, *found.causes]
    standing = standing_causes(heard.scans, recording.track, replayed.corrected)
    others = [*causes, *beam_causes(recording.sent), *standing]
    refined = _refined(replayed, recording, parameters, found.suspected, [*of_echoes, *others], options)
    runs = _runs(replayed, refined)
    if _positions_mislead(recording, heard.scans, extracting, odometry, runs, found.mount, options):
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
    with _bar(parts_of_refining(replayed.hypotheses), "part", "refine") as bar:
        suspicion = Suspicion(suspected, ranges_are_told(recording.sent))
        return refine(replayed, recording.track, parameters.map_settings(), suspicion, bar.update)


def _judged(
    heard: "_Heard", odometry: OdometryFound, parameters: ReplayParameters, replayed: Replayed,
    refined: Optional[Refined], causes: List[Cause], options: Namespace,
) -> MappedBag:  # fmt: skip
    """Return what was made of a recording, checked, and of those added to its map. causes: of what is wrong."""
    further = [heard.signs.turns()]
    if options.check:
        with _bar(REFITS, "fit", "check") as bar:
            further += refitted_verdicts(refined.solution, refined.batch, bar.update)
    if replayed.hypotheses is not None and replayed.hypotheses.told:
        odometry = odometry._replace(reason=f"{odometry.reason}; by the echoes {replayed.hypotheses.told}")
    findings, known = None, parameters
    if replayed.solver is not None:
        findings = Findings.of(replayed, refined, further, causes, _assumed(odometry, heard.mounted, refined, replayed))
        known = findings.calibration.applied(parameters)
    sessions = _further_sessions(replayed, known, options)
    run = _run(replayed, refined, sessions, known, None if findings is None else findings.trust)
    title = " ".join(bag.name for bag in options.bags)
    return MappedBag(title, heard.recording, odometry, known, replayed, refined, findings, sessions, run)


def _is_named(options: Namespace) -> bool:
    return options.odometry not in (None, OdometryKind.AUTO)


def _odometry(recording: Recording, options: Namespace) -> OdometryFound:
    if _is_named(options):
        return OdometryFound(options.odometry, "--odometry or a parameter says so")
    return odometry_of(recording, options.declared is MotionSource.STANDING)


def _followed(
    recording: Recording, scans: List[Scan], extracting: ReplayParameters, odometry: OdometryFound, options: Namespace
) -> Tuple[OdometryFound, ReplayParameters, Replayed]:
    """Return how the vehicle knows its motion, the parameters that suit that, and the replay with them.

    Where scans do not go on by a compass alone, or are too few to tell, a vehicle that strafes is tried too, unless the
    odometry is named.
    """
    parameters = with_odometry(extracting, odometry.kind, options.fixed, odometry.motion, odometry.is_said)
    replayed = _replayed(recording, scans, parameters)
    asked = odometry.kind is OdometryKind.HEADING and not _is_named(options) and replayed.solver is not None
    if not asked or not may_strafe(replayed.solver.solution):
        return odometry, parameters, replayed
    other = OdometryFound(OdometryKind.HOVERING, f"{odometry.reason}, and echoes speak for a vehicle that strafes")
    changed = with_odometry(extracting, other.kind, options.fixed)
    again = _replayed(recording, scans, changed)
    ranges = []
    if not ranges_are_told(recording.sent):
        suspected = echo_findings(scans, recording.sonar_in_base, replayed.corrections).suspected
        ranges = with_other_ranges(replayed.solver.solution, recording.track, suspected)
    if again.solver is not None and strafes(replayed.solver, again.solver, ranges):
        return other, changed, again
    return odometry, parameters, replace(replayed, strafing=again.solver)


def _positions_mislead(
    recording: Recording, scans: List[Scan], extracting: ReplayParameters, odometry: OdometryFound,
    believed: Sequence[Solution], mount: Hypothesis, options: Namespace,
) -> bool:  # fmt: skip
    """Return whether scans go on clearly better without reported positions than in all runs that believe these.

    False where somebody named the odometry. mount: of the sonar, as the echoes tell it. Where it is not as told, scans
    must go on badly with that mount, too.
    """
    asked = odometry.kind is OdometryKind.AUTO and not _is_named(options) and len(believed) > 0 and not mount.is_over
    if not asked or not all(map(goes_astray, believed)):
        return False
    if mount != AS_TOLD:
        believed = [_as_mounted(recording, extracting, odometry, options)]
        if not goes_astray(believed[0]):
            return False
    alone = _replayed(recording, scans, with_odometry(extracting, OdometryKind.HEADING, options.fixed))
    return goes_on_better(believed[-1], alone.solver.solution)


def _as_mounted(
    recording: Recording, extracting: ReplayParameters, odometry: OdometryFound, options: Namespace
) -> Solution:  # fmt: skip
    """Return the live run of a recording whose mount is put right as the echoes tell it."""
    asked = Namespace(**{**vars(options), "fix_mount": True})
    heard = _heard(recording, odometry, EchoExtractor(extracting.echoes()), asked)
    parameters = with_odometry(extracting, odometry.kind, options.fixed, odometry.motion, odometry.is_said)
    return _replayed(heard.recording, heard.scans, parameters).solver.solution


def _moves_are_turned(recording: Recording, mount: Hypothesis, options: Namespace) -> bool:
    """Return whether the odometry's moves are turned or mirrored, unless a turned sonar is to be put right."""
    if mount.mirrored is not Mirror.NOTHING:
        return True
    seems_turned = mount.turn != 0.0 and not mount.is_over and not options.fix_mount
    return seems_turned and moves_are_turned(recording.track, mount.turn)


def _runs(replayed: Replayed, refined: Optional[Refined]) -> List[Solution]:
    """Return the live run, and the one with what is wrong with its odometry taken out; none without a solver.

    Ranges that are made smaller let scans go on whatever is true: a run with these is left out.
    """
    runs = [] if replayed.solver is None else [replayed.solver.solution]
    if refined is not None and not any(isinstance(cause.fault, SonarFault) for cause in refined.motion.causes):
        runs.append(refined.solution)
    return runs


class _Heard(NamedTuple):
    """recording: as its echoes place it. mounted: what was put right of its mount, because that is asked for.

    over: whether the sonar was taken for upside down, as a cause; none where not.
    """

    recording: Recording
    scans: List[Scan]
    mounted: List[Cause]
    signs: ZDownSigns
    over: List[Cause]


def _heard(
    recording: Recording, odometry: OdometryFound, extractor: EchoExtractor, options: Namespace
) -> _Heard:  # fmt: skip
    """Return the scans of a recording, whose mount is put right where that is asked for.

    Where a compass alone turns against the echoes, it is taken for mirrored: else nothing lies on what was heard.
    """
    scans, mended = _scans(recording, extractor, options), []
    found = echo_findings(scans, recording.sonar_in_base) if options.fix_mount else EchoFindings([], AS_TOLD)
    if found.mount != AS_TOLD and found.mount.mirrored is Mirror.NOTHING:
        recording = recording.mounted(found.mount.turn, found.mount.is_over)
        scans = _scans(recording, extractor, options)
        mended = [replace(cause, is_mended=True, turn=TURN_DEVIATION) for cause in found.causes]
    signs = z_down_signs(np.array([placed.T_target_sonar[2, 3] for placed in recording.beams]), scans)
    _warn_of_z_down(signs, options)
    if odometry.kind not in COMPASS_ONLY or not signs.turns().fires:
        return _Heard(recording, scans, mended, signs, [])
    mirrored = recording.mounted(0.0, True)
    return _Heard(mirrored, _scans(mirrored, extractor, options), mended, signs, [_OVER])


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


def _scans(recording: Recording, extractor: EchoExtractor, options: Namespace) -> List[Scan]:
    with _bar(len(recording.beams), "beam", "echoes") as bar:
        chain = options.chain
        found = scans_of(recording, extractor) if chain is None else chain.scans(recording)
        return whole_turns(options.bags[0], len(recording.beams), found, bar.update)


def _warn_of_z_down(signs: ZDownSigns, options: Namespace) -> None:
    advice = "leave --ned out" if options.ned else "if the odometry counts north, east, down, give --ned"
    advice += "; if the head turns the other way, set head_turns"
    for sign in signs.lines():
        print(f"map_bag: {options.bags[0]}: {sign}; {advice}", file=sys.stderr)


def _replayed(recording: Recording, scans: List[Scan], parameters: ReplayParameters) -> Replayed:
    with _bar(len(scans), "scan", "match") as bar:
        return replay(recording, scans, parameters, bar.update)


def _tell_of_refused(replayed: Replayed, options: Namespace) -> None:
    """Say which scans were left out, and where none holds an echo. Raises RecordingError where no scan is left."""
    for reason, count in replayed.refused.items():
        print(f"map_bag: {options.bags[0]}: left out {count} {reason}", file=sys.stderr)
    if not any(map(len, replayed.scans)):
        print(f"map_bag: {options.bags[0]}: the map is empty: no echo stands out of what is heard", file=sys.stderr)
    if not replayed.updates:
        raise RecordingError(f"{options.bags[0]}: not one of {sum(replayed.refused.values())} scans could be used")


def _bar(total: int, unit: str, name: str) -> tqdm:
    return tqdm(total=total, unit=unit, desc=f"{name:9}", disable=None)


def _further_sessions(first: Replayed, parameters: ReplayParameters, options: Namespace) -> List[Session]:
    """Replay all bags but the first, each in the map of those before, with the first one's calibration."""
    bags, sessions = options.bags[1:], []
    if not bags:
        return []
    known = _stored(first, parameters)
    # No fork: this process may have threads that hold locks.
    with ProcessPoolExecutor(min(len(bags), cpu_count()), get_context("spawn")) as executor:
        request = replace(options.request, truth=None)
        waiting = [executor.submit(prepared, bag, request, parameters) for bag in bags]
        for bag, job in zip(bags, waiting):
            recording, scans = job.result()
            with _bar(len(scans), "scan", bag.name[:9]) as bar:
                sessions.append(Session(bag, replay(recording, scans, parameters, bar.update, known)))
            known = _stored(sessions[-1].replayed, parameters)
    return sessions


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
    counts = {
        "scans": len(replayed.scans),
        "matched": replayed.matched,
        "rejected": replayed.rejected,
        "left_out": dict(replayed.refused),
    }
    if refined is not None:
        poses[REFINED] = refined.poses
        stored = replace(stored, layers=refined.layers)
    paths = [session.trajectory(color) for session, color in zip(sessions, cycle(FURTHER_COLORS))]
    further = [path for path in paths if len(path.times)]
    return Run(replayed.times, poses, {**counts, "blocks": len(stored.shown)}, stored, trust, further)
