"""The command line of simulate_bag."""

import argparse
from pathlib import Path
from typing import Any, Dict, Sequence

from node_support.help import CommandLine
from node_support.parameter_files import assigned_values, read_values
from node_support.parameters import ParameterError

COMPRESSIONS = ("none", "lz4", "bz2")
_EPILOG = """\
examples:
  simulate_bag --world basin --out basin.bag
  simulate_bag --world harbour --out harbour.bag --set echo_model=physical odometry.scale_error=0.1
  simulate_bag --world my_pool.dae --script my_moves.yaml --out pool.bag --set sonar.ray_rows=15 seed=7

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
    parser.add_argument("--script", help="yaml file of the vehicle's moves (default: the tour of the package's world)")
    parser.add_argument("--out", required=True, type=Path, help="bag to write; an existing one is replaced")
    parser.add_argument(
        "--parameters", type=Path, help="yaml file of the simulator's parameters (default: the world's)"
    )
    parser.add_argument(
        "--set",
        nargs="+",
        action="extend",
        default=[],
        metavar="KEY=VALUE",
        help="any parameter; GROUP.KEY=VALUE for those in groups",
    )
    parser.add_argument("--robot", type=Path, help="URDF that says where the sonar is mounted (default: Charl-e)")
    parser.add_argument("--compression", choices=COMPRESSIONS, default="none", help="of the bag (default: %(default)s)")
    parser.add_argument("--quiet", action="store_true", help="no progress bar and no summary")
    return parser.parse_args(arguments)


def settings_of(options: argparse.Namespace, package: Path) -> Dict[str, Any]:
    """Return the simulator's parameters that a command line asks for; raises ParameterError.

    `package` is the package's folder, which holds the worlds, the tours and the demo's parameters.
    """
    own = package / "yaml" / f"sonar_simulator_{options.world}.yaml"
    chosen = options.parameters or (own if own.is_file() else None)
    values = read_values(chosen) if chosen else {}
    for key, value in assigned_values(options.set).items():
        _set(values, key, value)
    shipped = package / "worlds" / f"{options.world}.sdf"
    world = shipped if shipped.is_file() else Path(options.world).expanduser().absolute()
    if not world.exists():
        own_worlds = ", ".join(sorted(path.stem for path in shipped.parent.glob("*.sdf")))
        raise ParameterError(f"--world {options.world}: must be {own_worlds}, or a file that exists")
    tour = package / "yaml" / f"{options.world}_tour.yaml"
    if options.script is None and not tour.is_file():
        raise ParameterError(f"--script is missing: only worlds of this package have a tour, {options.world} has none")
    values["world"] = str(world)
    values["script"] = str(Path(options.script or tour).expanduser().absolute())
    return values


def _set(values: Dict[str, Any], key: str, value: Any) -> None:
    keys = key.split(".")
    if not all(keys) or len(keys) > 2:
        raise ParameterError(f"--set {key}: must be KEY=VALUE or GROUP.KEY=VALUE")
    group = values
    if len(keys) == 2:
        group = values[keys[0]] = dict(values.get(keys[0]) or {})
    group[keys[-1]] = value
