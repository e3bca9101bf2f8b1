"""Command line of map_bag."""

import argparse
import sys
from pathlib import Path
from typing import Any, Dict, List

from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.localisation.parameters import EstimatorName
from mlsm_manager.offline.live_file import replay_values
from mlsm_manager.offline.replay_parameters import ReplayParameters
from node_support.help import CommandLine
from node_support.parameter_files import assigned_values, read_values
from node_support.parameters import OLD_KEYS, ParameterError
from recordings.motion.vehicle_motion import MotionSource
from recordings.reader import ReadingParameters, add_reading_arguments, request_of

_EPILOG = "docs/map_bag.md describes the options, what is written, and how a vehicle is calibrated by it."
_ESTIMATORS = {
    "DISTRIBUTIONS": EstimatorName.SCAN_BY_SCAN,
    "THESIS": EstimatorName.THESIS,
    "SEGMENTS": EstimatorName.THESIS,
}
"""By the names that --matcher takes; the thesis's has two."""
_USAGE = "map_bag BAG [BAG ...] --out DIR [options]\n       map_bag BAG --inspect [options]"


def map_bag_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return bags, out, inspect, scheduler, refine, frames, parameters and request; exits on a bad command line.

    Raises ParameterError for an unknown key or a value that is not allowed.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    _check(parser, options)
    _check_motion(parser, options)
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
        help="recording: a bag of ROS 1 or ROS 2, or the log of a sonar's maker; each further one starts in the map of "
        "those before",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder to write to; created if missing")
    parser.add_argument("--inspect", action="store_true", help="say what a bag holds, and write nothing")
    _add_solving_arguments(parser)
    parser.add_argument(
        "--parameters", type=Path, metavar="FILE", help="yaml file, such as a live.yaml; --set overrides it"
    )
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="any parameter")
    add_reading_arguments(parser)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="a running Dask cluster that prepares further recordings"
    )
    return parser


def _add_solving_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what says how the poses of scans are found."""
    parser.add_argument(
        "--odometry", choices=[kind.value.lower() for kind in OdometryKind],
        help="what the vehicle knows of its motion (default: as the recording looks)",
    )  # fmt: skip
    parser.add_argument("--refine", action="store_true", help="fit the whole run at once afterwards")
    parser.add_argument(
        "--check", action="store_true",
        help="with --refine: fit the whole run five times more, with other settings and from another start, and say "
        "how far the paths lie apart",
    )  # fmt: skip
    parser.add_argument(
        "--no-calibrate", dest="calibrate", action="store_false",
        help="use sonar_delay and range_scale as they are set, without estimating how far they are off",
    )  # fmt: skip
    parser.add_argument(
        "--matcher", choices=list(_ESTIMATORS),
        help="match each scan alone instead of jointly, by this matcher: DISTRIBUTIONS, or that of the thesis",
    )  # fmt: skip


def _check(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse options that contradict each other, and a command without a folder to write to."""
    if options.refine and len(options.bags) > 1:
        parser.error("--refine fits one recording, not several")
    if options.check and not options.refine:
        parser.error("--check repeats the fit of --refine; give both")
    if options.out is None and not options.inspect:
        parser.error("--out is required, unless --inspect is given")
    if options.vehicle and len(options.bags) > 1:
        parser.error("--vehicle belongs to one recording, not to several")


def _values(options: argparse.Namespace) -> Dict[str, Any]:
    """Return the parameters that were set, by their names; one line on stderr names keys of an older version."""
    values, remarks = replay_values(read_values(options.parameters) if options.parameters else {})
    assigned, told = ReplayParameters.by_name(assigned_values(options.set))
    values.update(assigned)
    if remarks + told:
        print(f"map_bag: {OLD_KEYS}: {'; '.join(remarks + told)}", file=sys.stderr)
    if options.matcher:
        values.update(estimator=_ESTIMATORS[options.matcher].value)
    if not options.calibrate:
        values.update(range_scale_deviation=0.0, sonar_delay_deviation=0.0)
    return values


def _check_motion(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse what is said of the motion where it contradicts itself; nothing known means odometry none."""
    none, declared = OdometryKind.NONE.value.lower(), options.declared
    if declared is MotionSource.STANDING and options.odometry == none:
        parser.error("--standing says that the vehicle did not move; of one that moved give --unknown-motion instead")
    if declared is MotionSource.UNKNOWN:
        if options.odometry not in (None, none):
            parser.error(f"--odometry {options.odometry}: must be {none}, or left out, with --unknown-motion")
        options.odometry = none
