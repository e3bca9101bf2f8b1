"""Arguments of every program that reads recordings."""

import argparse
from pathlib import Path

from recordings.reading.parameters import ReadingParameters
from recordings.reading.reader import Request
from recordings.vehicle.motion import MotionNames, MotionSource


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what says which topics, frames and files of a recording are read."""
    parser.add_argument("--beams", metavar="TOPIC", help="topic of the beams (default: the likeliest)")
    parser.add_argument("--truth", metavar="TOPIC", help="topic of the true position, from which errors are measured")
    parser.add_argument(
        "--odometry-topic", metavar="TOPIC", help="poses to use instead of tf (default: the likeliest, if tf has none)"
    )
    known = parser.add_mutually_exclusive_group()
    known.add_argument(
        "--standing",
        dest="declared",
        action="store_const",
        const=MotionSource.STANDING,
        help="the vehicle did not move",
    )
    known.add_argument(
        "--unknown-motion", dest="declared", action="store_const", const=MotionSource.UNKNOWN,
        help="the vehicle moved, and nothing tells how: no position, no heading",
    )  # fmt: skip
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE", help="bag or table with the motion, if the recording has none"
    )
    parser.add_argument(
        "--offset", type=float, default=0.0, metavar="SECONDS",
        help="added to the stamps of the beams, whose clock is not that of the motion",
    )  # fmt: skip
    parser.add_argument("--odom-frame", default="odom", help="frame of the dead reckoning (default: %(default)s)")
    parser.add_argument("--base-frame", default="base_link", help="frame of the vehicle (default: %(default)s)")
    parser.add_argument("--ned", action="store_true", help="the odometry counts x north, y east, z down")


def request_of(options: argparse.Namespace, parameters: ReadingParameters) -> Request:
    """Return what the arguments ask for."""
    motion = MotionNames(options.odom_frame, options.base_frame, options.odometry_topic, options.declared, options.ned)
    return Request(options.beams, options.truth, motion, options.vehicle, options.offset, parameters)
