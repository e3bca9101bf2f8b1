"""Command lines of play_852, record_852 and convert_852."""

import argparse
import math
from typing import List

from node_support import topics
from node_support.help import CommandLine


def play_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return file, rate, loop, wait_for_subscribers, frame_id and inverted; exits on a bad command line."""
    parser = CommandLine("play_852", description="Publish the pings of a .852 log on sonar/raw.")
    parser.add_argument("file", help="log to play")
    _add_rate(parser)
    parser.add_argument("--loop", action="store_true", help="start again at the end")
    parser.add_argument("--wait-for-subscribers", action="store_true", help="start when somebody subscribes")
    _add_mount(parser)
    return parser.parse_args(arguments)


def record_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return file and driver; exits on a bad command line."""
    parser = CommandLine("record_852", description="Append the beams of sonar/raw to a .852 log.")
    parser.add_argument("file", help="log to append to")
    parser.add_argument("--driver", default="imagenex_852_driver", help="node whose settings go into the log")
    return parser.parse_args(arguments)


def convert_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return file, out, rate, start, topic, frame_id and inverted; exits on a bad command line."""
    parser = CommandLine("convert_852", description="Convert a .852 log to a bag.")
    parser.add_argument("file", help="log to convert")
    parser.add_argument("--out", required=True, help="bag to write; an existing one is replaced")
    _add_rate(parser)
    parser.add_argument(
        "--start", type=_positive, help="time of the first ping, s since 1970 (default: the log's, else the file's)"
    )
    parser.add_argument("--topic", default=f"/{topics.BEAMS}")
    _add_mount(parser)
    return parser.parse_args(arguments)


def _add_rate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rate", type=_positive, help="pings per second (default: as logged, and 10 where the log has no times)"
    )


def _add_mount(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--frame-id", default="sonar", help="frame of the head")
    parser.add_argument("--inverted", action="store_true", help="the head was mounted upside down")


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: must be above 0")
    return value
