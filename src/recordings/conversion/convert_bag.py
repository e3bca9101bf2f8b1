"""The program convert_bag."""

import argparse
import sys
from pathlib import Path
from typing import List

from node_support.help import CommandLine
from node_support.parameter_files import assigned_values
from node_support.parameters import ParameterError
from recordings.conversion.converted_bag import write_converted
from recordings.errors import RecordingError
from recordings.reading.arguments import add_reading_arguments, request_of
from recordings.reading.parameters import ReadingParameters
from recordings.reading.reader import read


def run_convert_bag() -> None:
    """Run convert_bag with the command line; ends with one line and status 1 when something is wrong."""
    try:
        print(convert_bag(sys.argv[1:]))
    except (ParameterError, RecordingError) as error:
        sys.exit(f"convert_bag: {error}")
    except OSError as error:
        sys.exit(f"convert_bag: {error.filename or 'output'}: {error.strerror or error}")
    except KeyboardInterrupt:
        sys.exit("convert_bag: interrupted; nothing was written")


def convert_bag(arguments: List[str]) -> str:
    """Convert what the arguments name and return in words what was written; exits on a bad command line.

    Raises ParameterError, RecordingError and OSError.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    parameters = ReadingParameters.from_mapping(assigned_values(options.set))
    request = request_of(options, parameters)
    held = read(options.recording, request)
    for note in held.notes:
        print(f"convert_bag: {options.recording}: {note}", file=sys.stderr)
    write_converted(options.out, held, request)
    lost = f", {held.found.refused} messages without a usable beam" if held.found.refused else ""
    return f"{options.out}: {len(held.found.beams)} beams{lost}; motion: {held.motion.source.value}"


def _parser() -> argparse.ArgumentParser:
    parser = CommandLine(
        "convert_bag", description="Write a recording of any kind as a bag of ROS 1 with /sonar/raw, /odom and tf."
    )
    parser.add_argument("recording", type=Path, help="a bag of ROS 1 or ROS 2, or the log of a sonar's maker")
    parser.add_argument("out", type=Path, help="bag to write; an existing one is replaced")
    parser.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="mounting and angles"
    )
    add_reading_arguments(parser)
    return parser
