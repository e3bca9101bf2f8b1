"""map_bag: a bag in; a map, trajectories and a summary out, without a master."""

import argparse
import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import Any, Dict, List

from georeferencing.asked import AskedOrigin
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.localisation.parameters import EstimatorName
from mlsm_manager.offline.bag_mapping import mapped_bag
from mlsm_manager.offline.charts import with_origin, write_charts
from mlsm_manager.offline.each import INDEX, map_each, options_of_one, recordings_in
from mlsm_manager.offline.mcap_file import write_mcap
from mlsm_manager.offline.recording import read_recording
from mlsm_manager.offline.replay import ReplayParameters, live_text, replay_values
from mlsm_manager.offline.run_files import MCAP, PICTURE, REPORT, errors_of, write_run, write_summary, write_trajectory
from mlsm_manager.offline.run_reports import mission_of, summary_lines, summary_of
from mlsm_manager.offline.thesis_chain import ThesisChain, thesis_values
from mlsm_manager.report.mission import Mission
from node_support.errors import RefusedInput
from node_support.files import make_folder, whole_folder, write_whole
from node_support.help import CommandLine, ending_in_one_line
from node_support.parameters import OLD_KEYS, ParameterError, assigned_values, read_values
from recordings.bags.bag import RecordingError
from recordings.bags.writers import mcap_writer
from recordings.motion.vehicle_motion import MotionSource
from recordings.reader import ReadingParameters, add_reading_arguments, request_of
from recordings.survey import report, survey


def run_map_bag() -> None:
    """Run map_bag with the command line; ends with one line and status 1 when something is wrong with the input."""
    with ending_in_one_line("map_bag", ParameterError, RecordingError):
        options = map_bag_arguments(sys.argv[1:])
        if options.inspect:
            print("\n\n".join(report(survey(bag, options.request), options.request) for bag in options.bags))
            return
        if options.each:
            _map_each(options, sys.argv[1:])
            return
        summary = map_bag(options)
    print("\n".join(summary_lines(summary, options)))


def _map_each(options: Namespace, arguments: List[str]) -> None:
    """Map each recording by itself; ends with status 1 when one of them has no map. Raises RecordingError, OSError."""
    own = options_of_one(arguments, options.bags)
    outcomes = map_each(recordings_in(options.bags), options.out, own, options.scheduler)
    without = [outcome for outcome in outcomes if not outcome.summary]
    print(f"{len(outcomes) - len(without)} of {len(outcomes)} mapped; {options.out / INDEX} shows them")
    if without:
        sys.exit("\n".join(f"map_bag: no map: {outcome.problem}" for outcome in without))


def map_bag(options: Namespace) -> Dict[str, Any]:
    """Map the bag and write all files or none; return what summary.json holds. Raises RecordingError and OSError."""
    start = time.monotonic()
    for bag in options.bags:
        bag.stat()
    if options.mcap:
        mcap_writer()  # Before the work, not after it
    recording = read_recording(options.bags[0], options.request)
    for note in recording.notes:
        print(f"map_bag: {options.bags[0]}: {note}", file=sys.stderr)
    make_folder(options.out)
    mapped = with_origin(mapped_bag(recording, options), options)
    errors = errors_of(mapped.run, mapped.recording)
    with whole_folder(options.out, options.read) as folder:
        write_run(folder, mapped.title, mapped.run, mapped.recording)
        for number, session in enumerate(mapped.sessions, start=2):
            write_trajectory(folder / f"trajectory_{number}.csv", session.replayed.times, session.replayed.poses)
        write_charts(folder, mapped)
        live = live_text(mapped.parameters, options.odom_frame, options.base_frame, options.chain)
        write_whole(folder / "live.yaml", live.encode())
        summary = summary_of(mapped, errors, time.monotonic() - start)
        write_summary(folder, summary)
        mission = mission_of(mapped, errors)
        if options.mcap:
            write_mcap(folder / MCAP, mission, folder / PICTURE)
        _write_report(folder, mission)
    return summary


def _write_report(folder: Path, mission: Mission) -> None:
    try:
        from mlsm_manager.report.page import write_report
    except ImportError:
        print("map_bag: report.html needs plotly; install it with: pip install plotly", file=sys.stderr)
        return
    write_report(folder / REPORT, mission)


_EPILOG = "docs/map_bag.md describes the options, what is written, and how a vehicle is calibrated by it."
_USAGE = """map_bag BAG [BAG ...] --out DIR [options]
       map_bag --each BAG|FOLDER ... --out DIR [options]
       map_bag BAG --inspect [options]"""


def map_bag_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return bags, out, inspect, scheduler, refine, frames, parameters and request; exits on a bad command line.

    Raises ParameterError for an unknown key or a value that is not allowed.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    _check(parser, options)
    options.read = [*options.bags, *filter(None, (options.vehicle, options.parameters))]
    values = _values(options)
    options.fixed = frozenset(values)
    if options.odometry is not None:
        options.odometry = OdometryKind(options.odometry.upper())
    elif "odometry" in values:
        options.odometry = OdometryKind(ReplayParameters.from_mapping({"odometry": values["odometry"]}).odometry)
    options.parameters = ReplayParameters.from_mapping(values)
    options.request = request_of(options, options.parameters.part(ReadingParameters))
    if options.refine and options.parameters.estimator is not EstimatorName.JOINT:
        raise ParameterError(f"estimator = {options.parameters.estimator.value}: must be JOINT with --refine")
    return options


def _parser() -> CommandLine:
    description = "Map a recording without a ROS master."
    parser = CommandLine("map_bag", usage=_USAGE, description=description, epilog=_EPILOG)
    parser.add_argument(
        "bags", type=Path, nargs="+", metavar="BAG",
        help="recording: a bag of ROS 1 or ROS 2, or a log or table of beams; each further one starts in the map of "
        "those before",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder to write to; created if missing")
    parser.add_argument(
        "--each", action="store_true",
        help="map every recording by itself, those in folders too, on all cores; goes on after a bad one, keeps maps "
        "that are there, and writes index.html",
    )  # fmt: skip
    parser.add_argument(
        "--mcap", action="store_true", help="write map.mcap too: standard messages of ROS 2 for Foxglove"
    )
    parser.add_argument("--inspect", action="store_true", help="say what a bag holds, and write nothing")
    _add_solving_arguments(parser)
    parser.add_argument(
        "--parameters", type=Path, metavar="FILE", help="yaml file, such as a live.yaml; --set overrides it"
    )
    parser.add_argument(
        "--origin", type=_origin, metavar="PLACE",
        help="write map and path for charts: where the map's origin is and its x axis points, clockwise from north: "
        '"41.2, 3.1, azimuth 12", 90 where none is given; "fixes": as satellites tell in the recording, "fixes, '
        'azimuth unknown" without a compass; "fixes, magnetic" and "41.2, 3.1, magnetic": it knows no declination',
    )  # fmt: skip
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="any parameter")
    add_reading_arguments(parser)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="with --each: a running Dask cluster whose workers map the recordings"
    )
    return parser


def _origin(text: str) -> AskedOrigin:
    try:
        return AskedOrigin.parsed(text)
    except RefusedInput as refused:
        raise argparse.ArgumentTypeError(str(refused)) from refused


def _add_solving_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--odometry", choices=[kind.value.lower() for kind in OdometryKind],
        help="what the vehicle knows of its motion; auto, the default, is as recording and echoes tell",
    )  # fmt: skip
    parser.add_argument("--refine", action="store_true", help="fit the whole run at once afterwards")
    parser.add_argument(
        "--check", action="store_true",
        help="with --refine: fit the whole run five times more, with other settings and from another start, and say "
        "how far the paths lie apart",
    )  # fmt: skip
    parser.add_argument(
        "--fix-mount", action="store_true",
        help="turn the sonar as the echoes tell, where they tell clearly that it is mounted otherwise than tf says",
    )  # fmt: skip
    parser.add_argument(
        "--no-calibrate", dest="calibrate", action="store_false",
        help="use sonar_delay and range_scale as they are set, without estimating how far they are off",
    )  # fmt: skip
    parser.add_argument(
        "--thesis", action="store_true",
        help="everything as the thesis of 2015 has it (yaml/thesis.yaml): cleaned clouds, each matched alone",
    )  # fmt: skip


def _check(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse options that contradict each other, and a command without a folder to write to.

    Of a vehicle of whose motion nothing is known the odometry is none.
    """
    if options.each:
        if options.inspect or options.vehicle:
            parser.error("--each goes with neither --inspect nor --vehicle")
    elif options.scheduler:
        parser.error("--scheduler shares the recordings of --each among workers; give both")
    elif options.refine and len(options.bags) > 1:
        parser.error("--refine fits one recording, not several")
    if options.check and not options.refine:
        parser.error("--check repeats the fit of --refine; give both")
    if options.thesis and len(options.bags) > 1 and not options.each:
        parser.error("--thesis maps one recording, not several")
    if options.out is None and not options.inspect:
        parser.error("--out is required, unless --inspect is given")
    if options.vehicle and len(options.bags) > 1:
        parser.error("--vehicle belongs to one recording, not to several")
    none, declared = OdometryKind.NONE.value.lower(), options.declared
    if declared is MotionSource.STANDING and options.odometry == none:
        parser.error("--standing is for a vehicle that did not move; for one that moved, give --unknown-motion instead")
    if declared is MotionSource.UNKNOWN:
        if options.odometry not in (None, OdometryKind.AUTO.value.lower(), none):
            parser.error(f"--odometry {options.odometry}: must be {none}, or left out, with --unknown-motion")
        options.odometry = none


def _values(options: argparse.Namespace) -> Dict[str, Any]:
    """Return the parameters that were set, by their names; one line on stderr names keys of an older version."""
    given = read_values(options.parameters) if options.parameters else {}
    options.chain = ThesisChain.from_values(thesis_values(given)) if options.thesis else None
    values = replay_values(thesis_values({}))[0] if options.thesis else {}
    own, remarks = replay_values(given)
    values.update(own)
    assigned, told = ReplayParameters.by_name(assigned_values(options.set))
    values.update(assigned)
    if remarks + told:
        print(f"map_bag: {OLD_KEYS}: {'; '.join(dict.fromkeys(remarks + told))}", file=sys.stderr)
    if not options.calibrate:
        values.update(
            range_scale_deviation=0.0, plateau_scale_deviation=0.0, plateau_scale_error=0.0, sonar_delay_deviation=0.0
        )
    return values
