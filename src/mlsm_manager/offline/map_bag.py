"""map_bag: a bag in; a map, trajectories and a summary out, without a master."""

import sys
import time
from argparse import Namespace
from dataclasses import replace
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy as np
from tqdm import tqdm

from mlsm_manager.matching.problem.scan import Scan
from mlsm_manager.offline.bag_recording import read_recording
from mlsm_manager.offline.echo_length import echo_sigma
from mlsm_manager.offline.echo_shape import echo_shape_of, suited
from mlsm_manager.offline.findings import Found
from mlsm_manager.offline.live_file import write_live
from mlsm_manager.offline.map_bag_arguments import map_bag_arguments
from mlsm_manager.offline.mission_report import mission_of
from mlsm_manager.offline.odometry_kind import OdometryFound, odometry_of, with_odometry
from mlsm_manager.offline.recording import Recording, scans_of
from mlsm_manager.offline.refinement import Refined, refine
from mlsm_manager.offline.refitting import refitted_verdicts
from mlsm_manager.offline.replay import Replayed, replay
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.offline.run_files import (
    CORRECTED,
    FURTHER_COLORS,
    ODOMETRY,
    REFINED,
    REPORT,
    Run,
    errors_of,
    write_run,
    write_summary,
    write_trajectory,
)
from mlsm_manager.offline.sessions import Session, add_session, executor_for, prepared_in_parallel
from mlsm_manager.report.mission import Mission
from mlsm_manager.self_check.north_east_down import ZDownSigns, z_down_signs
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.files.map_file import StoredMap
from node_support.parameters import ParameterError
from recordings.errors import RecordingError
from recordings.inspection.report import report
from recordings.inspection.survey import survey
from sonar_processing.beams.beam_correction import BeamCorrection

# The frame that live.yaml's nodes call their map by default.
_MAP_FRAME = "map"
# Loops that are printed; summary.json has all.
_MOST_LOOPS = 5


def run_map_bag() -> None:
    """Run map_bag with the command line; ends with one line and status 1 when something is wrong with the input."""
    try:
        options = map_bag_arguments(sys.argv[1:])
        if options.inspect:
            print("\n\n".join(report(survey(bag, options.request), options.request) for bag in options.bags))
            return
        summary = map_bag(options)
    except (ParameterError, RecordingError) as error:
        sys.exit(f"map_bag: {error}")
    except OSError as error:
        sys.exit(f"map_bag: {error.filename or 'output'}: {error.strerror or error}")
    except KeyboardInterrupt:
        sys.exit("map_bag: interrupted")
    print("\n".join(_report(summary, options)))


def map_bag(options: Namespace) -> Dict[str, Any]:
    """Map the bag and write the files; return what summary.json holds. Raises RecordingError and OSError."""
    start = time.monotonic()
    for bag in options.bags:
        bag.stat()
    recording = read_recording(options.bags[0], options.request)
    for note in recording.notes:
        print(f"map_bag: {options.bags[0]}: {note}", file=sys.stderr)
    options.out.mkdir(parents=True, exist_ok=True)
    odometry = _odometry(recording, options)
    parameters = with_odometry(options.parameters, odometry.kind, options.fixed)
    beams = [placed.beam for placed in recording.beams]
    parameters = suited(parameters, echo_shape_of(beams), options.fixed, echo_sigma(beams))
    recording = recording.corrected(parameters.part(BeamCorrection))
    scans = _scans(recording, parameters, options)
    signs = z_down_signs(np.array([placed.T_target_sonar[2, 3] for placed in recording.beams]), scans)
    _warn_of_z_down(signs, options)
    replayed = _replayed(recording, scans, parameters)
    _tell_of_refused(replayed, options)
    refined = _refined(recording, replayed, parameters) if options.refine else None
    refitted = _refitted(replayed, refined) if options.check else []
    found = None if replayed.solver is None else Found.of(replayed, refined, [signs.turns(), *refitted])
    known = parameters if found is None else found.calibration.applied(parameters)
    sessions = _further_sessions(replayed, known, options)
    run = _run(replayed, refined, sessions, known)
    run = run if found is None else replace(run, trust=found.trust)
    title = " ".join(bag.name for bag in options.bags)
    write_run(options.out, title, run, recording)
    for number, session in enumerate(sessions, start=2):
        write_trajectory(options.out / f"trajectory_{number}.csv", session.replayed.times, _poses(session.replayed))
    write_live(options.out / "live.yaml", known, options.odom_frame, options.base_frame)
    seconds = time.monotonic() - start
    errors = errors_of(run, recording)
    summary = {
        **run.counts,
        "odometry": {"profile": odometry.kind.value.lower(), "reason": odometry.reason},
        "beams_without_transform": recording.unplaced,
        "seconds": round(seconds, 2),
        "times_real_time": round(recording.seconds / seconds, 1),
        "solver_kernel": parameters.solver_kernel.resolved.value,
        "echoes": {"mode": parameters.mode.value, "match_resolution": parameters.match_resolution},
        **({} if found is None else found.to_mapping()),
        **({"sessions": [session.to_mapping() for session in sessions]} if sessions else {}),
        **errors,
    }
    write_summary(options.out, summary)
    _write_report(options.out, mission_of(title, recording, replayed, refined, run, found, errors, known.to_mapping()))
    return summary


def _odometry(recording: Recording, options: Namespace) -> OdometryFound:
    """Return which odometry the recording is mapped with: the one that was said, or else the one that it looks like."""
    if options.odometry is not None:
        return OdometryFound(options.odometry, "it was said so")
    return odometry_of(recording.track)


def _write_report(folder: Path, mission: Mission) -> None:
    """Write report.html where plotly is installed, else say what to install."""
    try:
        from mlsm_manager.report.page import write_report
    except ImportError:
        print("map_bag: report.html needs plotly; install it with: pip install plotly", file=sys.stderr)
        return
    write_report(folder / REPORT, mission)


def _warn_of_z_down(signs: ZDownSigns, options: Namespace) -> None:
    advice = "leave --ned out" if options.ned else "if the odometry counts north, east, down, give --ned"
    advice += "; if the head turns the other way, set head_turns"
    for sign in signs.lines():
        print(f"map_bag: {options.bags[0]}: {sign}; {advice}", file=sys.stderr)


def _scans(recording: Recording, parameters: ReplayParameters, options: Namespace) -> List[Scan]:
    with _bar(len(recording.beams), "beam", "echoes") as bar:
        scans = []
        for scan, beams in scans_of(recording, parameters.echoes()):
            scans.append(scan)
            bar.update(beams)
    if not scans:
        raise RecordingError(f"{options.bags[0]}: {len(recording.beams)} beams make no whole turn of the head")
    return scans


def _replayed(recording: Recording, scans: List[Scan], parameters: ReplayParameters) -> Replayed:
    with _bar(len(scans), "scan", "match") as bar:
        return replay(recording, scans, parameters, bar.update)


def _tell_of_refused(replayed: Replayed, options: Namespace) -> None:
    """Say which scans were left out. Raises RecordingError where no scan is left."""
    for reason, count in replayed.refused.items():
        print(f"map_bag: {options.bags[0]}: left out {count} {reason}", file=sys.stderr)
    if not replayed.updates:
        raise RecordingError(f"{options.bags[0]}: not one of {sum(replayed.refused.values())} scans could be used")


def _bar(total: Optional[int], unit: str, name: str) -> tqdm:
    return tqdm(total=total, unit=unit, desc=f"{name:9}", disable=None)


def _refined(recording: Recording, replayed: Replayed, parameters: ReplayParameters) -> Refined:
    with _bar(None, "", "refine"):
        return refine(recording.track, replayed.scans, replayed.solver, parameters.map_settings())


def _refitted(replayed: Replayed, refined: Refined) -> List[Verdict]:
    with _bar(None, "", "check"):
        return refitted_verdicts(replayed.solver, refined.batch)


def _further_sessions(first: Replayed, parameters: ReplayParameters, options: Namespace) -> List[Session]:
    """Replay all bags but the first, each in the map of those before, with the first one's calibration."""
    bags, sessions = options.bags[1:], []
    if not bags:
        return []
    known = _stored(first, parameters)
    with executor_for(len(bags), options.scheduler) as executor:
        read = partial(read_recording, request=replace(options.request, truth=None))
        for bag, ready in zip(bags, prepared_in_parallel(bags, read, parameters, executor)):
            with _bar(len(ready[1]), "scan", bag.name[:9]) as bar:
                sessions.append(add_session(bag, ready, parameters, known, bar.update))
            known = _stored(sessions[-1].replayed, parameters)
    return sessions


def _stored(replayed: Replayed, parameters: ReplayParameters) -> StoredMap:
    """Return the map as made when the recording ended: equal runs write equal files."""
    calibration = parameters.part(BeamCorrection).to_mapping()
    return StoredMap(_MAP_FRAME, dict(replayed.mapper.layers), calibration, replayed.times[-1])


def _poses(replayed: Replayed) -> Dict[str, np.ndarray]:
    return {ODOMETRY: replayed.odometry, CORRECTED: replayed.corrected}


def _run(replayed: Replayed, refined: Optional[Refined], sessions: List[Session], parameters: ReplayParameters) -> Run:
    poses = _poses(replayed)
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
    ways = [session.way(color) for session, color in zip(sessions, cycle(FURTHER_COLORS))]
    further = [way for way in ways if len(way.times)]
    return Run(replayed.times, poses, {**counts, "blocks": len(stored.shown)}, stored, further=further)


def _report(summary: Dict[str, Any], options: Namespace) -> List[str]:
    lines = [
        f"{summary['scans']} scans, {summary['matched']} matched, {summary['rejected']} rejected, "
        f"{summary['blocks']} blocks; {summary['seconds']} s, {summary['times_real_time']} times real time with "
        f"{summary['solver_kernel'].lower()}",
        f"odometry: {summary['odometry']['profile']}, because {summary['odometry']['reason']}",
    ]
    for name in (ODOMETRY, CORRECTED, REFINED):
        if name in summary:
            error = summary[name]
            lines.append(f"{name}: mean {error['mean']} m, sd {error['sd']} m, max {error['max']} m")
    for session in summary.get("sessions", []):
        found = session["found_after_scans"]
        place = "not found in the map, nothing added" if found is None else f"found in the map with scan {found + 1}"
        lines.append(f"{session['bag']}: {session['scans']} scans, {session['matched']} matched, {place}")
    if "loops" in summary:
        lines += [f"loop: {line}" for line in summary["loops"]["found"][:_MOST_LOOPS]]
    if "trust" in summary:
        lines.append(summary["trust"])
    files = ["map.mlsm", "map.ply", "map.png", "trajectory.csv", "*.tum", "live.yaml", "summary.json"]
    if (options.out / REPORT).exists():
        files.append(REPORT)
    return [*lines, f"in {options.out}: {' '.join(files)}"]
