"""The command line of simulate_bag. Free of ROS."""

import argparse
from pathlib import Path
from typing import Any, Dict, List, Mapping, Sequence

import yaml

from node_support.command_line import CommandLine
from node_support.parameters import ParameterError

COMPRESSIONS = ("none", "lz4", "bz2")
_EPILOG = """\
examples:
  simulate_bag --world basin --out basin.bag
  simulate_bag --world harbour --out harbour.bag --set echo_model=physical --set odometry.scale_error=0.1
  simulate_bag --world my_pool.dae --script my_moves.yaml --out pool.bag --set sonar.ray_rows=15 --set seed=7

yaml/sonar_simulator_default.yaml lists the keys that --set takes."""


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return world, script, out, parameters, set, robot, compression and quiet; exits on a bad command line."""
    parser = CommandLine(
        "simulate_bag",
        description="Write the bag of a simulated survey: beams, tf, odometry and truth. Needs no ROS master.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--world", required=True, help="file, or the name of a world of this package: basin, tank, harbour"
    )
    parser.add_argument("--script", help="moves of the vehicle; default: the tour of the package's world")
    parser.add_argument("--out", required=True, type=Path, help="bag to write; an existing one is replaced")
    parser.add_argument("--parameters", type=Path, help="yaml file of the simulator's parameters; default: the world's")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="one parameter; group.key=value"
    )
    parser.add_argument("--robot", type=Path, help="URDF that says where the sonar is mounted; default: Charl-e")
    parser.add_argument("--compression", choices=COMPRESSIONS, default="none")
    parser.add_argument("--quiet", action="store_true", help="no progress bar and no summary")
    return parser.parse_args(arguments)


def settings_of(options: argparse.Namespace, package: Path) -> Dict[str, Any]:
    """Return the simulator's parameters that a command line asks for; raises ParameterError.

    `package` is the package's folder, which holds the worlds, the tours and the demo's parameters.
    """
    own = package / "yaml" / f"sonar_simulator_{options.world}.yaml"
    chosen = options.parameters or (own if own.is_file() else None)
    values = _file_values(chosen) if chosen else {}
    for text in options.set:
        _set(values, text)
    shipped = package / "worlds" / f"{options.world}.sdf"
    tour = package / "yaml" / f"{options.world}_tour.yaml"
    if options.script is None and not tour.is_file():
        raise ParameterError(f"--script is missing: only worlds of this package have a tour, {options.world} has none")
    values["world"] = str(shipped if shipped.is_file() else Path(options.world).expanduser().absolute())
    values["script"] = str(Path(options.script or tour).expanduser().absolute())
    return values


def _file_values(path: Path) -> Dict[str, Any]:
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}") from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise ParameterError(f"{path}: not yaml: {' '.join(str(error).split())}") from error
    if not isinstance(values, Mapping):
        raise ParameterError(f"{path}: must hold keys and values")
    return dict(values)


def _set(values: Dict[str, Any], text: str) -> None:
    key, equals, value = text.partition("=")
    keys: List[str] = key.split(".")
    if not equals or not all(keys) or len(keys) > 2:
        raise ParameterError(f"--set {text}: must be key=value or group.key=value")
    group = values
    if len(keys) == 2:
        group = values[keys[0]] = dict(values.get(keys[0]) or {})
    try:
        group[keys[-1]] = yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise ParameterError(f"--set {text}: {value!r} is no value") from error
