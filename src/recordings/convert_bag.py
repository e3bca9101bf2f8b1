"""The program convert_bag: writes a recording as a bag of ROS 1 that our nodes play, or as an MCAP file of ROS 2."""

import argparse
import sys
from pathlib import Path
from typing import Any, Iterator, List, Tuple, Union

import numpy as np

from node_support import topics
from node_support.files import check_output, whole_file
from node_support.help import CommandLine, ending_in_one_line
from node_support.parameters import ParameterError, assigned_values
from recordings.bags.bag import RecordingError
from recordings.bags.messages import Placing
from recordings.bags.writers import BagWriter, McapWriter
from recordings.motion.pose_track import PoseTrack
from recordings.motion.vehicle_motion import MotionSource
from recordings.reader import Content, ReadingParameters, Request, add_reading_arguments, read, request_of
from sonar_processing.beams.beam import Beam

_BEAMS = f"/{topics.BEAMS}"
_ODOMETRY = f"/{topics.ODOMETRY}"
_TRUTH = f"/{topics.GROUND_TRUTH}"
_MCAP = ".mcap"
_Writer = Union[BagWriter, McapWriter]
_Stamped = Tuple[int, str, Any]  # ns, topic and message
_LATEST_NS = 2**32 * 10**9 - 1  # the latest stamp that a bag of ROS 1 holds, of the year 2106


def run_convert_bag() -> None:
    """Run convert_bag with the command line; ends with one line and status 1 when something is wrong."""
    with ending_in_one_line("convert_bag", ParameterError, RecordingError):
        print(convert_bag(sys.argv[1:]))


def convert_bag(arguments: List[str]) -> str:
    """Convert what the arguments name and return in words what was written; exits on a bad command line.

    Raises ParameterError, RecordingError and OSError.
    """
    options = _parser().parse_args(arguments)
    ending = _MCAP if options.out.suffix == _MCAP else ".bag"
    check_output(options.out, [options.recording], options.overwrite, ending)
    request = request_of(options, ReadingParameters.from_mapping(assigned_values(options.set)))
    content = read(options.recording, request)
    if content.motion.source is MotionSource.UNSAID:
        raise RecordingError(f"{options.recording}: {content.motion.notes[0]}")
    for note in content.notes:
        print(f"convert_bag: {options.recording}: {note}", file=sys.stderr)
    write_converted(options.out, content, request)
    lost = f", {content.recorded.refused} messages without a usable beam" if content.recorded.refused else ""
    return f"{options.out}: {len(content.recorded.beams)} beams{lost}; motion: {content.motion.source.value}"


def _parser() -> argparse.ArgumentParser:
    description = "Write beams, odometry and tf of any recording as a bag of ROS 1, or as an MCAP file of ROS 2."
    parser = CommandLine("convert_bag", description=description)
    parser.add_argument("recording", type=Path, help="a bag of ROS 1 or ROS 2, or a log or table of beams")
    parser.add_argument("out", type=Path, help="file to write: .bag for ROS 1, .mcap for ROS 2")
    parser.add_argument("--overwrite", action="store_true", help="replace a file that exists")
    parser.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="mounting and angles"
    )
    add_reading_arguments(parser)
    return parser


def write_converted(path: Path, content: Content, request: Request) -> None:
    """Write beams, odometry, transforms and truth, whole or not at all. Raises OSError, and RecordingError for a
    stamp that a bag cannot hold.
    """
    writer = McapWriter if path.suffix == _MCAP else BagWriter
    with whole_file(path) as temporary, writer(temporary) as bag:
        messages = [*_beams(bag, content.recorded.beams), *_motion(bag, content, request)]
        if content.truth is not None:
            messages += _odometry(bag, _TRUTH, content.truth, "map", "")
        messages.sort(key=lambda one: one[0])
        start, end = messages[0][0], messages[-1][0]
        if start < 0 or end > _LATEST_NS:
            raise RecordingError(f"{path}: stamps from {start} to {end} ns, must be from 0 to {_LATEST_NS}")
        fixed = [(link, track) for link, track in content.motion.tree.tracks.items() if track.is_fixed]
        transforms = [bag.transform(pose, bag.time(start), *link) for link, track in fixed for _, pose in _poses(track)]
        bag.write(topics.STATIC_TRANSFORMS, bag.transforms(transforms), start)
        for stamp_ns, topic, message in messages:
            bag.write(topic, message, stamp_ns)


def _beams(bag: _Writer, beams: List[Beam]) -> Iterator[_Stamped]:
    for beam in beams:
        message = bag.stamped("underwater_map_construction/SonarScanLine", bag.time(beam.stamp_ns), beam.frame_id)
        message.angle, message.sensorAngle = beam.angle, beam.sensor_angle
        message.intensities = np.asarray(beam.intensities, dtype=np.uint8)
        message.range_resolution = beam.range_resolution
        message.maxrange_meters = beam.range_resolution * beam.intensities.size
        yield beam.stamp_ns, _BEAMS, message


def _motion(bag: _Writer, content: Content, request: Request) -> Iterator[_Stamped]:
    tracks, names = content.motion.tree.tracks, request.motion
    for link, track in tracks.items():
        for stamp_ns, pose in () if track.is_fixed else _poses(track):
            transform = bag.transform(pose, bag.time(stamp_ns), *link)
            yield stamp_ns, topics.TRANSFORMS, bag.transforms([transform])
    odometry = tracks.get((names.odom_frame, names.base_frame))
    if odometry is not None and not odometry.is_fixed:
        yield from _odometry(bag, _ODOMETRY, odometry, names.odom_frame, names.base_frame)


def _odometry(bag: _Writer, topic: str, track: PoseTrack, frame: str, child: str) -> Iterator[_Stamped]:
    for stamp_ns, pose in _poses(track):
        yield stamp_ns, topic, bag.odometry(pose, bag.time(stamp_ns), frame, child)


def _poses(track: PoseTrack) -> Iterator[Tuple[int, Placing]]:
    return zip(map(int, track.stamps_ns), map(Placing, track.translations, track.rotations))
