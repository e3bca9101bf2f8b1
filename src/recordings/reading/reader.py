"""Reads beams and motion of a recording, and a true path if there is one."""

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, List, Optional, TypeVar

from recordings.bags.bag import Bag
from recordings.beams.bag_beams import beam_topic, beams_of_bag
from recordings.beams.found_beams import FoundBeams
from recordings.beams.makers_logs import is_makers_log, makers_beams
from recordings.errors import RecordingError
from recordings.messages.poses import pose_track
from recordings.reading.parameters import ReadingParameters
from recordings.transforms.frame_tree import FrameTree
from recordings.transforms.pose_track import PoseTrack
from recordings.vehicle.csv_file import is_table, motion_of_csv
from recordings.vehicle.motion import Motion, MotionNames, declared_motion, motion_of_bag
from recordings.vehicle.mount import mounted

_Found = TypeVar("_Found")


@dataclass(frozen=True)
class Request:
    """What is read of a recording, and from where.

    beams: topic of the beams; None: the likeliest. truth: topic of the true pose, or None. vehicle: a bag or table with
    the motion, where the recording itself has none. offset: s that are added to the stamps of the beams, so that they
    are of the same clock as the motion.
    """

    beams: Optional[str] = None
    truth: Optional[str] = None
    motion: MotionNames = field(default_factory=MotionNames)
    vehicle: Optional[Path] = None
    offset: float = 0.0
    parameters: ReadingParameters = field(default_factory=ReadingParameters)


@dataclass(frozen=True)
class Read:
    """What a recording holds. The motion's tree links all frames of beams with odom. notes: what was assumed."""

    found: FoundBeams
    motion: Motion
    truth: Optional[PoseTrack]

    @property
    def notes(self) -> List[str]:
        """Sentences."""
        return [*self.motion.notes, *self.found.notes]


def read(path: Path, request: Request) -> Read:
    """Return what is wanted of a recording. Raises RecordingError, with everything that is missing at once."""
    with ExitStack() as stack:
        main = None if is_makers_log(path) else stack.enter_context(Bag(path))
        vehicle = None if request.vehicle is None or is_table(request.vehicle) else Bag(request.vehicle)
        bags = [main, stack.enter_context(vehicle) if vehicle else None]
        problems: List[str] = []
        topic = _tried(problems, lambda: None if main is None else beam_topic(main, request.beams))
        truth = _tried(problems, lambda: _truth([bag for bag in bags if bag is not None], request))
        motion = _tried(problems, lambda: _motion(bags[1] or main, request))
        if problems:
            raise RecordingError(f"{path}: {'; '.join(problems)}")
        found = makers_beams(path) if main is None else beams_of_bag(main, topic, request.parameters)
    if not found.beams:
        raise RecordingError(f"{path}: none of {found.refused} messages holds a beam that can be used")
    found = found.later(request.offset)
    tree, notes = mounted(motion.tree, request.motion.base_frame, found, request.parameters)
    _check_common_time(path, found, tree, request)
    return Read(found, Motion(tree, motion.source, [*motion.notes, *notes]), truth)


def _tried(problems: List[str], step: Callable[[], Optional[_Found]]) -> Optional[_Found]:
    try:
        return step()
    except RecordingError as error:
        problems.append(str(error))
        return None


def _motion(bag: Optional[Bag], request: Request) -> Motion:
    if request.vehicle is not None and is_table(request.vehicle):
        return motion_of_csv(request.vehicle, request.motion)
    if bag is not None:
        return motion_of_bag(bag, request.motion, request.truth)
    if request.motion.declared is not None:
        return declared_motion(FrameTree(), request.motion)
    raise RecordingError(
        "the log of a sonar does not tell where the vehicle was: give a bag or a table with --vehicle, or --standing, "
        "or --unknown-motion"
    )


def _truth(bags: List[Bag], request: Request) -> Optional[PoseTrack]:
    topic = request.truth
    if topic is None:
        return None
    holder = next((bag for bag in bags if topic in bag.topics), None)
    if holder is None:
        names = ", ".join(sorted({name for bag in bags for name in bag.topics}))
        raise RecordingError(f"no topic {topic}; there are {names or 'none at all'}")
    try:
        track = pose_track(message for _, message in holder.messages(topic))
    except AttributeError:
        kind = holder.topics[topic].type
        raise RecordingError(f"{topic} holds {kind}, must be Odometry or PoseStamped") from None
    if not len(track):
        raise RecordingError(f"{topic} holds no pose")
    return track.turned_up() if request.motion.z_is_down else track


def _check_common_time(path: Path, found: FoundBeams, tree: FrameTree, request: Request) -> None:
    """Raise RecordingError where no beam was taken while the motion is known."""
    names, stamps = request.motion, found.stamps_ns
    track = tree.tracks.get((names.odom_frame, names.base_frame))
    if track is None or track.covers(stamps).any():
        return
    (first, last), (start, end) = stamps[[0, -1]] * 1e-9, track.stamps_ns[[0, -1]] * 1e-9
    raise RecordingError(
        f"{path}: beams from {first:.3f} to {last:.3f} s, motion from {start:.3f} to {end:.3f} s: no time in common; "
        f"--offset SECONDS is added to the stamps of the beams; if both were started together, {start - first:.3f}"
    )
