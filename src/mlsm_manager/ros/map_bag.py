"""map_bag: a bag in; a map, trajectories and a summary out, without a master."""

import sys
import time
from argparse import Namespace
from typing import Any, Dict, List, Optional

from tqdm import tqdm

from mlsm_manager.matching.problem.scan import Scan
from mlsm_manager.offline.echo_shape import echo_shape_of, suited
from mlsm_manager.offline.findings import Found
from mlsm_manager.offline.live_file import write_live
from mlsm_manager.offline.map_bag_arguments import map_bag_arguments
from mlsm_manager.offline.recording import Recording, RecordingError, scans_of
from mlsm_manager.offline.refinement import Refined, refine
from mlsm_manager.offline.replay import Replayed, replay
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.offline.run_files import CORRECTED, ODOMETRY, REFINED, Run, errors_of, write_run, write_summary
from mlsm_manager.ros.bag_recording import BagNames, read_recording
from node_support.parameters import ParameterError
from sonar_processing.beams.beam_correction import BeamCorrection


def run_map_bag() -> None:
    """Run map_bag with the command line; ends with one line and status 1 when something is wrong with the input."""
    try:
        options = map_bag_arguments(sys.argv[1:])
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
    names = BagNames(options.beams, options.odom_frame, options.base_frame, options.truth)
    recording = read_recording(options.bag, names)
    options.out.mkdir(parents=True, exist_ok=True)
    shape = echo_shape_of([placed.beam for placed in recording.beams])
    parameters = suited(options.parameters, shape, options.fixed)
    recording = recording.corrected(parameters.part(BeamCorrection))
    replayed = _replayed(recording, _scans(recording, parameters, options), parameters)
    refined = _refined(recording, replayed, parameters) if options.refine else None
    found = None if replayed.solver is None else Found.of(replayed, refined)
    run = _run(replayed, refined, found)
    write_run(options.out, options.bag.name, run, recording)
    known = parameters if found is None else found.calibration.applied(parameters)
    write_live(options.out / "live.yaml", known, names.odom_frame, names.base_frame)
    seconds = time.monotonic() - start
    summary = {
        **run.counts,
        "beams_without_transform": recording.unplaced,
        "seconds": round(seconds, 2),
        "times_real_time": round(recording.seconds / seconds, 1),
        "echoes": {"mode": parameters.mode.value, "match_resolution": parameters.match_resolution},
        **({} if found is None else found.to_mapping()),
        **errors_of(run, recording),
    }
    write_summary(options.out, summary)
    return summary


def _scans(recording: Recording, parameters: ReplayParameters, options: Namespace) -> List[Scan]:
    with _bar(len(recording.beams), "beam", "echoes") as bar:
        scans = []
        for scan, beams in scans_of(recording, parameters.echoes()):
            scans.append(scan)
            bar.update(beams)
    if not scans:
        raise RecordingError(f"{options.bag}: {len(recording.beams)} beams make no whole turn of the head")
    return scans


def _replayed(recording: Recording, scans: List[Scan], parameters: ReplayParameters) -> Replayed:
    with _bar(len(scans), "scan", "match") as bar:
        return replay(recording, scans, parameters, bar.update)


def _bar(total: Optional[int], unit: str, name: str) -> tqdm:
    return tqdm(total=total, unit=unit, desc=f"{name:9}", disable=None)


def _refined(recording: Recording, replayed: Replayed, parameters: ReplayParameters) -> Refined:
    with _bar(None, "", "refine"):
        return refine(recording.track, replayed.scans, replayed.solver, parameters.resolution)


def _run(replayed: Replayed, refined: Optional[Refined], found: Optional[Found]) -> Run:
    poses, blocks = {ODOMETRY: replayed.odometry, CORRECTED: replayed.corrected}, replayed.mapper.blocks
    if refined is not None:
        poses[REFINED], blocks = refined.poses, refined.blocks
    counts = {"scans": len(replayed.scans), "matched": replayed.matched, "rejected": replayed.rejected}
    checked = None if found is None else found.trust
    return Run(replayed.times, poses, blocks, {**counts, "blocks": len(blocks)}, checked)


def _report(summary: Dict[str, Any], options: Namespace) -> List[str]:
    lines = [
        f"{summary['scans']} scans, {summary['matched']} matched, {summary['rejected']} rejected, "
        f"{summary['blocks']} blocks; {summary['seconds']} s, {summary['times_real_time']} times real time"
    ]
    for name in (ODOMETRY, CORRECTED, REFINED):
        if name in summary:
            error = summary[name]
            lines.append(f"{name}: mean {error['mean']} m, sd {error['sd']} m, max {error['max']} m")
    if "trust" in summary:
        lines.append(summary["trust"])
    return [*lines, f"in {options.out}: map.ply map.png trajectory.csv live.yaml summary.json"]
