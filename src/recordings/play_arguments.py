"""Command line of play_bag."""

import argparse
import math
from pathlib import Path
from typing import List

from node_support.help import CommandLine


def play_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return bag, rate, topics, ned, odom_frame and base_frame; exits on a bad command line."""
    parser = CommandLine(
        "play_bag", description="Play a ROS 1 bag with /clock, once every topic has a subscriber. It is read first."
    )
    parser.add_argument("bag", type=Path, help="bag to play")
    parser.add_argument("--rate", type=_positive, default=1.0, help="times real time (default: 1)")
    parser.add_argument("--topics", nargs="+", help="play only these (default: all)")
    parser.add_argument("--ned", action="store_true", help="the odometry counts x north, y east, z down: turn it up")
    parser.add_argument("--odom-frame", default="odom", help="frame of the odometry that --ned turns (default: odom)")
    parser.add_argument("--base-frame", default="base_link", help="frame of the vehicle (default: base_link)")
    return parser.parse_args(arguments)


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: must be above 0")
    return value
