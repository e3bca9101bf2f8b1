"""map_bag: a bag in; a map, trajectories and a summary out, without a master."""

import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import Any, Dict

from mlsm_manager.offline.bag_mapping import MappedBag, mapped_bag, poses_of
from mlsm_manager.offline.bag_recording import read_recording
from mlsm_manager.offline.live_file import write_live
from mlsm_manager.offline.map_bag_arguments import map_bag_arguments
from mlsm_manager.offline.mission_report import mission_of
from mlsm_manager.offline.run_files import REPORT, errors_of, write_run, write_summary, write_trajectory
from mlsm_manager.offline.run_summary import summary_lines, summary_of
from mlsm_manager.report.mission import Mission
from node_support.files import make_folder
from node_support.parameters import ParameterError
from recordings.bags.bag import RecordingError
from recordings.survey import report, survey


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
    print("\n".join(summary_lines(summary, options)))


def map_bag(options: Namespace) -> Dict[str, Any]:
    """Map the bag and write the files; return what summary.json holds. Raises RecordingError and OSError."""
    start = time.monotonic()
    for bag in options.bags:
        bag.stat()
    recording = read_recording(options.bags[0], options.request)
    for note in recording.notes:
        print(f"map_bag: {options.bags[0]}: {note}", file=sys.stderr)
    make_folder(options.out)
    mapped = mapped_bag(recording, options)
    _write_results(mapped, options)
    errors = errors_of(mapped.run, mapped.recording)
    summary = summary_of(mapped, errors, time.monotonic() - start)
    write_summary(options.out, summary)
    _write_report(options.out, mission_of(mapped, errors))
    return summary


def _write_results(mapped: MappedBag, options: Namespace) -> None:
    """Write map, trajectories and live.yaml, each whole or not at all."""
    write_run(options.out, mapped.title, mapped.run, mapped.recording)
    for number, session in enumerate(mapped.sessions, start=2):
        write_trajectory(options.out / f"trajectory_{number}.csv", session.replayed.times, poses_of(session.replayed))
    write_live(options.out / "live.yaml", mapped.parameters, options.odom_frame, options.base_frame)


def _write_report(folder: Path, mission: Mission) -> None:
    """Write report.html where plotly is installed, else say what to install."""
    try:
        from mlsm_manager.report.page import write_report
    except ImportError:
        print("map_bag: report.html needs plotly; install it with: pip install plotly", file=sys.stderr)
        return
    write_report(folder / REPORT, mission)
