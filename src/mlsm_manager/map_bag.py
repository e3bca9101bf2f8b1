"""map_bag: a bag in; a map, trajectories and a summary out, without a master."""

import sys
import time
from argparse import Namespace
from typing import Any, Dict, List, Optional

from tqdm import tqdm

from mlsm_manager.bag_recording import BagNames, read_recording
from mlsm_manager.map_bag_arguments import map_bag_arguments
from mlsm_manager.mapping.recording import Recording, RecordingError
from mlsm_manager.mapping.refinement import Refined, refine
from mlsm_manager.mapping.replay import Replayed, replay
from mlsm_manager.run_files import CORRECTED, ODOMETRY, REFINED, Run, errors_of, write_run, write_summary
from node_support.parameters import ParameterError


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
        sys.exit("map_bag: interrupted; nothing was written")
    print("\n".join(_told(summary, options)))


def map_bag(options: Namespace) -> Dict[str, Any]:
    """Map the bag and write the files; return what summary.json holds. Raises RecordingError and OSError."""
    start = time.monotonic()
    names = BagNames(options.beams, options.odom_frame, options.base_frame, options.truth)
    recording = read_recording(options.bag, names)
    replayed = _replayed(recording, options)
    run = _run(replayed, _refined(recording, replayed) if options.refine else None)
    write_run(options.out, options.bag.name, run, recording)
    seconds = time.monotonic() - start
    summary = {
        **run.counts,
        "beams_without_transform": recording.unplaced,
        "seconds": round(seconds, 2),
        "times_real_time": round(recording.seconds / seconds, 1),
        **errors_of(run, recording),
    }
    write_summary(options.out, summary)
    return summary


def _replayed(recording: Recording, options: Namespace) -> Replayed:
    with tqdm(total=len(recording.beams), unit="beam", desc=options.bag.name, disable=None) as bar:
        return replay(recording, options.parameters, bar.update)


def _refined(recording: Recording, replayed: Replayed) -> Refined:
    with tqdm(total=len(replayed.updates), unit="scan", desc="refine", disable=None) as bar:
        return refine(recording, replayed, bar.update)


def _run(replayed: Replayed, refined: Optional[Refined]) -> Run:
    poses = {ODOMETRY: replayed.odometry, CORRECTED: replayed.corrected}
    blocks = replayed.mapper.shown.blocks
    counts = {"scans": len(replayed.updates), "matched": replayed.matched, "rejected": replayed.rejected}
    if refined is not None:
        poses[REFINED], blocks = refined.poses, refined.blocks
        counts["edges"] = refined.edges
    return Run(replayed.times, poses, blocks, {**counts, "blocks": len(blocks)})


def _told(summary: Dict[str, Any], options: Namespace) -> List[str]:
    lines = [
        f"{summary['scans']} scans, {summary['matched']} matched, {summary['rejected']} rejected, "
        f"{summary['blocks']} blocks; {summary['seconds']} s, {summary['times_real_time']} times real time"
    ]
    for name in (ODOMETRY, CORRECTED, REFINED):
        if name in summary:
            error = summary[name]
            lines.append(f"{name}: mean {error['mean']} m, sd {error['sd']} m, max {error['max']} m")
    return [*lines, f"in {options.out}: map.ply map.png trajectory.csv summary.json"]
