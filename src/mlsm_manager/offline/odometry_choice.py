"""Which odometry a recording is mapped with: where echoes doubt the one that it reports, others are tried."""

from argparse import Namespace
from dataclasses import replace
from typing import List, Optional, Sequence, Tuple

from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.sonar_trials import SonarFault
from mlsm_manager.localisation.odometry_profiles import OdometryKind, strafes
from mlsm_manager.odometry.changed_tracks import Mirror
from mlsm_manager.offline.heard_scans import heard_in, progress_bar
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.refinement import Refined
from mlsm_manager.offline.replay import Replayed, ReplayParameters, replay
from mlsm_manager.offline.suited_parameters import OdometryFound, goes_on, goes_on_better, odometry_of, with_odometry
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.self_check.beam_causes import ranges_are_told
from mlsm_manager.self_check.course import moves_are_turned
from mlsm_manager.self_check.echo_causes import echo_findings
from mlsm_manager.self_check.fault_trials import likelier_without, logged_without
from mlsm_manager.self_check.scan_pairs import AS_TOLD, Hypothesis
from mlsm_manager.self_check.standing import standing_causes
from mlsm_manager.self_check.verdict import Answer
from recordings.motion.vehicle_motion import MotionSource
from sonar_processing.filters.echo_extractor import EchoExtractor


def is_named(options: Namespace) -> bool:
    """Return whether somebody says how the vehicle knows its motion."""
    return options.odometry not in (None, OdometryKind.AUTO)


def odometry_in(recording: Recording, options: Namespace) -> OdometryFound:
    """Return how the vehicle of a recording knows its motion: as somebody says, else as its odometry shows."""
    if is_named(options):
        return OdometryFound(options.odometry, "--odometry or a parameter says so")
    return odometry_of(recording, options.declared is MotionSource.STANDING)


def followed(
    recording: Recording, scans: List[Scan], extracting: ReplayParameters, odometry: OdometryFound, options: Namespace
) -> Tuple[OdometryFound, ReplayParameters, Replayed]:
    """Return how the vehicle knows its motion, the parameters that suit that, and the replay with them.

    Where scans do not go on by a compass alone, or are too few to tell, a vehicle that strafes is tried too, unless the
    odometry is named.
    """
    parameters = with_odometry(extracting, odometry.kind, options.fixed, odometry.motion, odometry.is_said)
    replayed = _replayed(recording, scans, parameters)
    asked = odometry.kind is OdometryKind.HEADING and not is_named(options) and replayed.solver is not None
    if not asked or goes_on(replayed.solver.solution) is Answer.FINE:
        return odometry, parameters, replayed
    other = OdometryFound(OdometryKind.HOVERING, f"{odometry.reason}, and echoes speak for a vehicle that strafes")
    changed = with_odometry(extracting, other.kind, options.fixed)
    again = _replayed(recording, scans, changed)
    if again.solver is None:
        return odometry, parameters, replayed
    if strafes(replayed.solver, again.solver, _ahead_without_faults(recording, scans, replayed, again.solver.log)):
        return other, changed, again
    return odometry, parameters, replace(replayed, strafing=again.solver)


def _ahead_without_faults(
    recording: Recording, scans: List[Scan], replayed: Replayed, strafing: RunLog
) -> List[Tuple[RunLog, Solution]]:
    """Return runs of a vehicle that goes ahead, each without one fault with which it may seem to strafe.

    strafing: what is logged of a vehicle that strafes. Each run comes after this log without the same fault.
    """
    suspected = list(echo_findings(scans, recording.sonar_in_base, replayed.corrections).suspected)
    standing = standing_causes(scans, recording.track, replayed.corrected)
    suspected += [cause.fault for cause in standing if cause.fault is not None]
    are_told = ranges_are_told(recording.sent)
    found = likelier_without(replayed.solver.solution, recording.track, suspected, are_told)
    return [(logged_without(strafing, fault, run), run) for fault, run in found]


def positions_mislead(
    recording: Recording, scans: List[Scan], extracting: ReplayParameters, odometry: OdometryFound,
    believed: Sequence[Solution], mount: Hypothesis, options: Namespace,
) -> bool:  # fmt: skip
    """Return whether scans go on clearly better without reported positions than in all runs that believe these.

    False where somebody named the odometry. mount: of the sonar, as the echoes tell it. Where it is not as told, scans
    must go on badly with that mount, too.
    """
    asked = odometry.kind is OdometryKind.AUTO and not is_named(options) and len(believed) > 0 and not mount.is_over
    if not asked or any(goes_on(run) is not Answer.DOUBTFUL for run in believed):
        return False
    if mount != AS_TOLD:
        fixing = Namespace(**{**vars(options), "fix_mount": True})
        heard = heard_in(recording, odometry.kind, EchoExtractor(extracting.echoes()), fixing)
        parameters = with_odometry(extracting, odometry.kind, options.fixed, odometry.motion, odometry.is_said)
        believed = [_replayed(heard.recording, heard.scans, parameters).solver.solution]
        if goes_on(believed[0]) is not Answer.DOUBTFUL:
            return False
    alone = _replayed(recording, scans, with_odometry(extracting, OdometryKind.HEADING, options.fixed))
    return goes_on_better(believed[-1], alone.solver.solution)


def are_moves_turned(recording: Recording, mount: Hypothesis, options: Namespace) -> bool:
    """Return whether the odometry's moves are turned or mirrored, unless a turned sonar is to be put right."""
    if mount.mirrored is not Mirror.NOTHING:
        return True
    seems_turned = mount.turn != 0.0 and not mount.is_over and not options.fix_mount
    return seems_turned and moves_are_turned(recording.track, mount.turn)


def believed_runs(replayed: Replayed, refined: Optional[Refined]) -> List[Solution]:
    """Return the live run, and the one with what is wrong with its odometry taken out; none without a solver.

    Ranges that are made smaller let scans go on whatever is true: a run with these is left out.
    """
    runs = [] if replayed.solver is None else [replayed.solver.solution]
    if refined is not None and not any(isinstance(cause.fault, SonarFault) for cause in refined.motion.causes):
        runs.append(refined.motion.run)
    return runs


def _replayed(recording: Recording, scans: List[Scan], parameters: ReplayParameters) -> Replayed:
    with progress_bar(len(scans), "scan", "match") as bar:
        return replay(recording, scans, parameters, bar.update)
