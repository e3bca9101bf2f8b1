"""The program simulate_bag: writes what a simulated vehicle records into a bag, without a ROS master."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any, Dict, Optional, Sequence

import numpy as np
import yaml
from tqdm import tqdm

from node_support import topics
from node_support.files import check_output, package_folder, whole_file
from node_support.help import CommandLine, ending_in_one_line
from node_support.parameters import ParameterError, assigned_values, read_values
from recordings.bags.messages import Placing
from recordings.bags.writers import COMPRESSIONS, BagWriter
from sonar_simulator.simulation.moment_messages import MomentMessages, map_origin
from sonar_simulator.simulation.robot import RobotDescription, tilted
from sonar_simulator.simulation.simulation import BASE_FRAME, SONAR_FRAME, Drive, Moment, Settings, Simulation

START_TIME = 1000.0  # s: stamps before it, as of late transforms, are still above 0
BEAMS_AT_ONCE = 120  # Beams cast together: one revolution of the usual head
_RENAMED = {topics.VELOCITY: topics.VELOCITY_COMMANDS}
_SETTINGS_TOPIC = "/sonar_simulator/settings"


class SimulatedBag:
    """Writes moments into a bag, at the times and on the topics that the simulator node would use."""

    def __init__(self, bag: BagWriter, simulation: Simulation, settings: Settings) -> None:
        self._bag = bag
        self._simulation = simulation
        self._settings = settings
        self._messages = MomentMessages(bag.make, np.asarray)
        self._origin = map_origin(simulation.T_world_start, settings.simulator.instruments)

    def begin(self, robot: RobotDescription) -> None:
        """Write what applies to the whole bag: the fixed transforms and the parameters."""
        stamp_ns = _stamp_ns(0.0)
        stamp = self._bag.time(stamp_ns)
        transforms = [
            self._messages.transform(Placing.of(joint.T_parent_child), stamp, joint.parent, joint.child)
            for joint in robot.fixed_joints
        ]
        self._write(topics.STATIC_TRANSFORMS, self._messages.transforms(transforms), stamp_ns)
        values, told = self._settings.to_mapping(), self._bag.make("std_msgs/String")
        # File names only, so that the bag does not depend on the folder.
        files = {key: Path(values[key]).name for key in ("world", "script")}
        told.data = yaml.safe_dump({**values, **files}, sort_keys=False)
        self._write(_SETTINGS_TOPIC, told, stamp_ns)

    def add(self, moment: Moment) -> None:
        """Write everything that belongs to a moment; its transforms are one message."""
        stamp_ns = _stamp_ns(moment.time)
        stamp, instruments = self._bag.time(stamp_ns), self._settings.simulator.instruments
        messages = self._messages.at(moment, stamp, self._simulation.sonar.max_range, instruments, self._origin)
        if messages[0][0] != topics.TRANSFORMS:
            messages.insert(0, (topics.TRANSFORMS, self._messages.transforms([])))
        mount = Placing.of(tilted(self._simulation.T_base_sonar, moment.tilt))
        messages[0][1].transforms.append(self._messages.transform(mount, stamp, BASE_FRAME, SONAR_FRAME))
        for topic, message in messages:
            self._write(topic, message, stamp_ns)

    def _write(self, topic: str, message: Any, stamp_ns: int) -> None:
        topic = _RENAMED.get(topic, topic)
        self._bag.write(topic if topic.startswith("/") else f"/{topic}", message, stamp_ns)


def _stamp_ns(seconds: float) -> int:
    return round(float(START_TIME + seconds) * 1e9)


_EPILOG = """\
examples:
  simulate_bag --world basin --out basin.bag
  simulate_bag --world harbour --out harbour.bag --odometry-error 0.1 --set echo_model=physical
  simulate_bag --world my_pool.dae --script my_moves.yaml --out pool.bag --set sonar.ray_rows=15 seed=7

yaml/sonar_simulator_default.yaml lists the keys that --set takes."""


def parse(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Return world, script, out, parameters, set, robot, compression and quiet; exits on a bad command line."""
    parser = CommandLine(
        "simulate_bag",
        description="Write the bag of a simulated survey: beams, tf, odometry and truth. Needs no ROS master.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--world", required=True, help="file, or a world of this package: basin, tank, harbour")
    parser.add_argument("--script", help="yaml file of the vehicle's moves (default: the tour of the package's world)")
    parser.add_argument("--out", required=True, type=Path, help="bag to write (.bag)")
    parser.add_argument("--overwrite", action="store_true", help="replace a bag that exists")
    parser.add_argument("--parameters", type=Path, help="yaml file of parameters (default: the world's)")
    parser.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE",
        help="any parameter; GROUP.KEY=VALUE for those in groups",
    )  # fmt: skip
    parser.add_argument(
        "--odometry-error", type=float, metavar="SHARE",
        help="true distances are 1 + SHARE times those of the odometry (default: odometry.scale_error)",
    )  # fmt: skip
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
    if options.odometry_error is not None:
        _set(values, "odometry.scale_error", options.odometry_error)
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


def run_simulate_bag(arguments: Optional[Sequence[str]] = None) -> None:
    """Write the bag that a command line asks for; end with one line and status 1 where that cannot be."""
    with ending_in_one_line("simulate_bag", ParameterError):
        _run(parse(arguments))


def _run(options: argparse.Namespace) -> None:
    check_output(options.out, [], options.overwrite, ".bag")
    package = package_folder()
    settings = Settings.from_mapping(settings_of(options, package))
    if settings.simulator.drive is not Drive.SCRIPT:
        raise ParameterError("drive = 'CMD_VEL': nobody sends commands while a bag is written; must be SCRIPT")
    robot = RobotDescription.from_file(options.robot or package / "urdf/charle.urdf")
    simulation = Simulation(settings, package, robot, lambda line: print(f"simulate_bag: {line}", file=sys.stderr))
    start, duration, beams = time.monotonic(), simulation.duration, 0
    with tqdm(total=round(duration), unit="s", disable=options.quiet or None, desc=options.out.name) as bar:
        with whole_file(options.out.absolute()) as temporary, BagWriter(temporary, options.compression) as bag:
            writer = SimulatedBag(bag, simulation, settings)
            writer.begin(robot)
            for moment in simulation.moments(settings.simulator.clock_rate, BEAMS_AT_ONCE):
                writer.add(moment)
                beams += moment.ping is not None
                bar.update(round(moment.time) - bar.n)
        bar.update(bar.total - bar.n)
    seconds = time.monotonic() - start
    if not options.quiet:
        print(
            f"{options.out}: {duration:.0f} s of simulated time, {beams} beams, "
            f"{options.out.stat().st_size / 1e6:.1f} MB, written in {seconds:.1f} s "
            f"({duration / seconds:.0f} times real time); true distances are "
            f"{1.0 + settings.odometry.scale_error:.3g} times those of the odometry"
        )
