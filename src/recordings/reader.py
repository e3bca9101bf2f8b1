"""Reads beams and motion of a recording, and a true path if there is one; and the arguments of programs that do."""

import argparse
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Callable, List, Optional, Tuple, TypeVar

import numpy as np

from node_support.geometry import quaternion_of
from recordings.bags.bag import Bag, RecordingError, missing_topic
from recordings.beams import RecordedBeams, beam_topic, beams_of_bag
from recordings.makers_logs import is_makers_log, makers_beams
from recordings.motion.autopilot_log import is_autopilot_log, motion_of_autopilot
from recordings.motion.clock_offset import clock_offset
from recordings.motion.frame_tree import FrameTree, frame_tree, pose_track
from recordings.motion.motion_table import is_table, motion_of_csv
from recordings.motion.pose_track import PoseTrack
from recordings.motion.vehicle_motion import (
    Motion,
    MotionNames,
    MotionSource,
    declared_motion,
    linked,
    motion_of_bag,
    unsaid_motion,
)
from recordings.ping_viewer_next import vehicle_headings
from sonar_processing.beams.parameters import SonarPoseParameters
from sonar_processing.beams.reader import BeamMessageParameters

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class ReadingParameters(SonarPoseParameters, BeamMessageParameters):
    """Where the sonar is mounted, and how the angles in its messages are understood."""


@dataclass(frozen=True)
class Request:
    """What is read of a recording, and from where.

    beams: topic of the beams; None: the likeliest. truth: topic of the true pose, or None. vehicle: a bag or table with
    the motion, where the recording itself has none. offset: s that are added to the stamps of the beams, so that they
    are of the same clock as the motion; None: 0, or what the echoes tell where `vehicle` is an autopilot's log.
    """

    beams: Optional[str] = None
    truth: Optional[str] = None
    motion: MotionNames = field(default_factory=MotionNames)
    vehicle: Optional[Path] = None
    offset: Optional[float] = None
    parameters: ReadingParameters = field(default_factory=ReadingParameters)


@dataclass(frozen=True)
class Content:
    """What a recording holds. The motion's tree links all frames of beams with odom. notes: what was assumed."""

    recorded: RecordedBeams
    motion: Motion
    truth: Optional[PoseTrack]

    @property
    def notes(self) -> List[str]:
        return [*self.motion.notes, *self.recorded.notes]


def read(path: Path, request: Request) -> Content:
    """Return what is wanted of a recording. Raises RecordingError, with everything that is missing at once."""
    with ExitStack() as stack:
        main = None if is_makers_log(path) else stack.enter_context(bag_of_beams(path))
        vehicle = None if request.vehicle is None or _reader_of_motion(request.vehicle) else Bag(request.vehicle)
        bags = [main, stack.enter_context(vehicle) if vehicle else None]
        problems: List[str] = []
        topic = tried(problems, lambda: None if main is None else beam_topic(main, request.beams))
        truth = tried(problems, lambda: _truth([bag for bag in bags if bag is not None], request))
        motion = tried(problems, lambda: motion_for(path, bags[1] or main, request))
        if problems:
            raise RecordingError(f"{path}: {'; '.join(problems)}")
        recorded = makers_beams(path) if main is None else beams_of_bag(main, topic, request.parameters)
    if not recorded.beams:
        raise RecordingError(f"{path}: {recorded.notes[-1] if recorded.notes else 'no message of beams'}")
    tree, notes = mounted(motion.tree, request.motion.base_frame, recorded, request.parameters)
    recorded = recorded.later(_offset(recorded, tree, request, notes))
    _check_common_time(path, recorded, tree, request)
    return Content(recorded, Motion(tree, motion.source, [*motion.notes, *notes]), truth)


def bag_of_beams(path: Path) -> Bag:
    """Return the bag at `path`. Raises RecordingError where there is none, also for an autopilot's log."""
    if is_autopilot_log(path):
        raise RecordingError(f"{path}: an autopilot's log holds no beams: map the sonar's with --vehicle {path}")
    return Bag(path)


def mounted(
    tree: FrameTree, base_frame: str, recorded: RecordedBeams, parameters: SonarPoseParameters
) -> Tuple[FrameTree, List[str]]:
    """Return a tree in which every frame of beams is linked to the vehicle, and what was assumed for that."""
    notes, mount = [], parameters
    vehicle, pose = mount.mounted_in or base_frame, mount.matrix()
    words = (
        f"taken as mounted in {vehicle} at {mount.mount_x:g} {mount.mount_y:g} {mount.mount_z:g} m, "
        f"yaw {mount.mount_yaw:g} rad{', upside down' if mount.upside_down else ''} "
        "(--set mount_x, mount_y, mount_z, mount_yaw, upside_down)"
    )
    for frame in sorted({beam.frame_id for beam in recorded.beams}):
        if tree.links_between(base_frame, frame) is None:
            tree = tree.with_track(vehicle, frame, PoseTrack.fixed(pose[:3, 3], quaternion_of(pose)))
            notes.append(f"tf does not place {frame} on the vehicle: {words}")
    return tree, notes


def tried(problems: List[str], step: Callable[[], Optional[_Result]]) -> Optional[_Result]:
    """Return what a step finds; where it raises RecordingError, add its text to the problems and return None."""
    try:
        return step()
    except RecordingError as error:
        problems.append(str(error))
        return None


def _offset(recorded: RecordedBeams, tree: FrameTree, request: Request, notes: List[str]) -> float:
    """Return what is added to the stamps of the beams, s; adds to the notes what echoes tell. Raises RecordingError."""
    if request.offset is not None or request.vehicle is None or not is_autopilot_log(request.vehicle):
        return request.offset or 0.0
    names, now = request.motion, np.zeros(1, dtype=np.int64)
    mount = tree.poses(names.base_frame, recorded.beams[0].frame_id, now)[0][0]
    seconds, deviation = clock_offset(recorded.beams, tree.tracks[(names.odom_frame, names.base_frame)], mount)
    notes.append(
        f"by the echoes the clock of {request.vehicle.name} is {seconds:.2f} s ahead of that of the beams, "
        f"deviation {deviation:.2f} s (--offset sets it)"
    )
    return seconds


def _reader_of_motion(path: Path) -> Optional[Callable[[Path, MotionNames], Motion]]:
    """Return what reads a file that is no bag and holds the vehicle's motion, None for any other."""
    if is_table(path):
        return motion_of_csv
    return motion_of_autopilot if is_autopilot_log(path) else None


def motion_for(path: Path, bag: Optional[Bag], request: Request) -> Motion:
    """Return the motion that a request for a recording at `path` asks for; `bag` may hold it. Raises RecordingError."""
    own = None if request.vehicle is None else _reader_of_motion(request.vehicle)
    if own is not None:
        motion, names = own(request.vehicle, request.motion), request.motion
        if bag is None:
            return motion
        # The file tells no frames, but the bag of the beams may tell where things are mounted.
        fixed = {link: track for link, track in frame_tree(bag).tracks.items() if track.is_fixed}
        track = motion.tree.tracks[(names.odom_frame, names.base_frame)]
        return replace(motion, tree=linked(FrameTree(fixed), names, track))
    if bag is not None:
        return motion_of_bag(bag, request.motion, request.truth)
    if request.motion.declared is not None:
        return declared_motion(FrameTree(), request.motion)
    headings = vehicle_headings(path)
    if headings is not None:
        note = f"no odometry: {len(headings)} headings from {path.name}, the position is unknown"
        return Motion(linked(FrameTree(), request.motion, headings), MotionSource.HEADING, [note])
    return unsaid_motion(FrameTree(), request.motion, "beams only")


def _truth(bags: List[Bag], request: Request) -> Optional[PoseTrack]:
    topic = request.truth
    if topic is None:
        return None
    holder = next((bag for bag in bags if topic in bag.topics), None)
    if holder is None:
        raise missing_topic(topic, bags)
    try:
        track = pose_track(message for _, message in holder.messages(topic))
    except AttributeError:
        kind = holder.topics[topic].type
        raise RecordingError(f"{topic} holds {kind}, must be Odometry or PoseStamped") from None
    if not len(track):
        raise RecordingError(f"{topic} holds no pose")
    return request.motion.upward(track)


def _check_common_time(path: Path, recorded: RecordedBeams, tree: FrameTree, request: Request) -> None:
    """Raise RecordingError where no beam was taken while the motion is known."""
    names, stamps = request.motion, recorded.stamps_ns
    track = tree.tracks.get((names.odom_frame, names.base_frame))
    if track is None or track.covers(stamps).any():
        return
    (first, last), (start, end) = stamps[[0, -1]] * 1e-9, track.stamps_ns[[0, -1]] * 1e-9
    raise RecordingError(
        f"{path}: beams from {first:.3f} to {last:.3f} s, motion from {start:.3f} to {end:.3f} s: no time in common; "
        f"--offset SECONDS is added to the stamps of the beams; if both were started together, {start - first:.3f}"
    )


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what says which topics, frames and files of a recording are read."""
    parser.add_argument("--beams", metavar="TOPIC", help="topic of the beams (default: the likeliest)")
    parser.add_argument("--truth", metavar="TOPIC", help="topic of the true position, from which errors are measured")
    parser.add_argument(
        "--odometry-topic", metavar="TOPIC", help="poses to use instead of tf (default: the likeliest, if tf has none)"
    )
    known = parser.add_mutually_exclusive_group()
    known.add_argument(
        "--standing", dest="declared", action="store_const", const=MotionSource.STANDING,
        help="the vehicle did not move",
    )  # fmt: skip
    known.add_argument(
        "--unknown-motion", dest="declared", action="store_const", const=MotionSource.UNKNOWN,
        help="the vehicle moved, and nothing tells how: no position, no heading",
    )  # fmt: skip
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE",
        help="bag, table or autopilot's log (.tlog, .BIN) with the motion, if the recording has none",
    )  # fmt: skip
    parser.add_argument(
        "--offset", type=float, metavar="SECONDS",
        help="added to the stamps of the beams, whose clock is not that of the motion; the default is 0, or with an "
        "autopilot's log what the echoes tell",
    )  # fmt: skip
    parser.add_argument("--odom-frame", default="odom", help="frame of the dead reckoning (default: %(default)s)")
    parser.add_argument("--base-frame", default="base_link", help="frame of the vehicle (default: %(default)s)")
    parser.add_argument("--ned", action="store_true", help="the odometry counts x north, y east, z down")


def request_of(options: argparse.Namespace, parameters: ReadingParameters) -> Request:
    motion = MotionNames(options.odom_frame, options.base_frame, options.odometry_topic, options.declared, options.ned)
    return Request(options.beams, options.truth, motion, options.vehicle, options.offset, parameters)
