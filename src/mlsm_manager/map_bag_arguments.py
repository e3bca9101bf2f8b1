"""Command line of map_bag."""

import argparse
from pathlib import Path
from typing import Any, List, Tuple

import yaml

from mlsm_manager.mapping.replay_parameters import ReplayParameters
from mlsm_manager.matching.matchers import MatcherName


def map_bag_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return bag, out, truth, refine, beams, odom_frame, base_frame and parameters; exits on a bad command line.

    Raises ParameterError for an unknown key or a value that is not allowed.
    """
    parser = argparse.ArgumentParser("map_bag", description="Map a recording without a master, as fast as it can.")
    parser.add_argument("bag", type=Path, help="recording with beams and tf (odom, base_link, sonar)")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to; it is made when it is not there")
    parser.add_argument("--matcher", choices=[name.value for name in MatcherName], help="which matcher")
    parser.add_argument("--truth", help="topic of the true position, to measure errors against")
    parser.add_argument("--refine", action="store_true", help="smooth the whole run afterwards")
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="any parameter")
    parser.add_argument("--beams", default="/sonar/raw", help="topic of the beams (default: %(default)s)")
    parser.add_argument("--odom-frame", default="odom", help="frame of the dead reckoning (default: %(default)s)")
    parser.add_argument("--base-frame", default="base_link", help="frame of the vehicle (default: %(default)s)")
    options = parser.parse_args(arguments)
    values = dict(_pair(text, parser) for text in options.set)
    if options.matcher:
        values["matcher"] = options.matcher
    options.parameters = ReplayParameters.from_mapping(values)
    return options


def _pair(text: str, parser: argparse.ArgumentParser) -> Tuple[str, Any]:
    key, separator, value = text.partition("=")
    if not (key and separator):
        parser.error(f"--set {text}: must be KEY=VALUE")
    try:
        return key, yaml.safe_load(value)
    except yaml.YAMLError:
        return key, value
