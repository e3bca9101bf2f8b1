"""The program simulate_bag."""

import sys
import time
from argparse import Namespace
from typing import List

from tqdm import tqdm

from node_support.files import package_folder
from node_support.parameters import ParameterError
from sonar_simulator.simulation.bag_arguments import parse, settings_of
from sonar_simulator.simulation.simulated_bag import write_bag
from sonar_simulator.simulation.simulation import Drive
from sonar_simulator.simulation.simulation_setup import Settings, make_setup
from sonar_simulator.vehicle.robot_description import DescriptionError, RobotDescription


def run_simulate_bag() -> None:
    """Run simulate_bag with the command line."""
    sys.exit(main(sys.argv[1:]))


def main(arguments: List[str]) -> int:
    """Write the bag that a command line asks for; return the exit status. An error is reported in one line."""
    options = parse(arguments)
    try:
        _run(options)
    except (ParameterError, DescriptionError) as error:
        print(f"simulate_bag: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"simulate_bag: {options.out}: {error.strerror}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("simulate_bag: stopped; nothing was written", file=sys.stderr)
        return 130
    return 0


def _run(options: Namespace) -> None:
    package = package_folder()
    settings = Settings.from_mapping(settings_of(options, package))
    if settings.simulator.drive is not Drive.SCRIPT:
        raise ParameterError("drive = 'CMD_VEL': nobody sends commands while a bag is written; must be SCRIPT")
    robot = RobotDescription.from_file(options.robot or package / "urdf/charle.urdf")
    setup = make_setup(settings, package, robot, lambda line: print(f"simulate_bag: {line}", file=sys.stderr))
    start = time.monotonic()
    duration = setup.simulation.duration
    with tqdm(total=round(duration), unit="s", disable=options.quiet or None, desc=options.out.name) as bar:
        beams = write_bag(
            options.out.absolute(),
            setup,
            settings,
            robot,
            options.compression,
            lambda now: bar.update(round(now) - bar.n),
        )
        bar.update(bar.total - bar.n)
    seconds = time.monotonic() - start
    if not options.quiet:
        print(
            f"{options.out}: {duration:.0f} s of simulated time, {beams} beams, "
            f"{options.out.stat().st_size / 1e6:.1f} MB, written in {seconds:.1f} s "
            f"({duration / seconds:.0f} times real time)"
        )
