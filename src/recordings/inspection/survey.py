"""Everything that can be said of a bag before its beams are read."""

from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict, List, Optional, TypeVar

import numpy as np

from node_support.errors import RefusedInput
from recordings.bags.bag import Bag, Topic
from recordings.beams.bag_beams import beam_topic
from recordings.beams.found_beams import FoundBeams
from recordings.beams.makers_logs import is_makers_log
from recordings.errors import RecordingError
from recordings.inspection.axes import signs_of_z_down
from recordings.messages.poses import frame_tree
from recordings.messages.roles import Role, with_role
from recordings.reading.reader import Request
from recordings.transforms.frame_tree import FrameTree
from recordings.vehicle.motion import Motion, motion_of_bag
from recordings.vehicle.mount import mounted
from sonar_processing.messages.reader import BeamReader

_Found = TypeVar("_Found")


@dataclass(frozen=True)
class Survey:
    """What a bag holds.

    topics: by their roles, the likeliest first. tree: tf as recorded. beams: topic that would be used, or None.
    z_down: signs of it. assumed, missing: sentences.
    """

    path: Path
    is_ros2: bool
    topics: Dict[Role, List[Topic]]
    tree: FrameTree
    beams: Optional[str]
    z_down: List[str]
    assumed: List[str]
    missing: List[str]


def survey(path: Path, request: Request) -> Survey:
    """Return what a bag holds and lacks for a request. Raises RecordingError only for a file that cannot be read."""
    if is_makers_log(path):
        raise RecordingError(
            f"{path}: the log of a sonar holds beams only; give the motion with --vehicle, or "
            "--standing, or --unknown-motion"
        )
    with Bag(path) as bag:
        tree = frame_tree(bag)
        missing: List[str] = []
        assumed: List[str] = []
        topic = _tried(missing, lambda: beam_topic(bag, request.beams))
        motion = _tried(missing, lambda: motion_of_bag(bag, request.motion, request.truth))
        if motion is not None:
            assumed += motion.notes
        if topic is not None:
            first = _first_beams(bag, topic, request)
            assumed += first.notes
            missing += [] if first.beams else [f"none of the first messages of {topic} holds a beam that can be used"]
            if motion is not None and first.beams:
                _look_at_place(motion, first, request, assumed, missing)
        signs = signs_of_z_down(bag, tree.frames)
        if signs and not request.motion.z_is_down:
            assumed.append("the odometry counts x, y left, z up; if it counts north, east, down, give --ned")
        topics = {role: with_role(bag.topics, role) for role in Role}
        return Survey(path, bag.is_ros2, topics, tree, topic, signs, assumed, missing)


def _tried(missing: List[str], step: Callable[[], _Found]) -> Optional[_Found]:
    try:
        return step()
    except RecordingError as error:
        missing.append(str(error))
        return None


def _first_beams(bag: Bag, topic: str, request: Request) -> FoundBeams:
    """Return the beams of the first message that holds some."""
    reader = BeamReader(request.parameters)
    for _, message in bag.messages(topic):
        try:
            reading = reader.read(bag.topics[topic].type, message)
        except RefusedInput:
            continue
        return FoundBeams(reading.beams, [False] * len(reading.beams), notes=reading.notes)
    return FoundBeams([], [])


def _look_at_place(motion: Motion, first: FoundBeams, request: Request, assumed: List[str], missing: List[str]) -> None:
    tree, notes = mounted(motion.tree, request.motion.base_frame, first, request.parameters)
    assumed += notes
    beam, names = first.beams[0], request.motion
    link = tree.tracks.get((names.odom_frame, names.base_frame))
    if link is not None and not link.covers(np.array([beam.stamp_ns])).any():
        reason = tree.why_not(names.odom_frame, beam.frame_id, np.array([beam.stamp_ns]))
        assumed.append(f"the first beams are left out: {reason}")
    missing += [] if tree.way(names.odom_frame, beam.frame_id) is not None else [f"{beam.frame_id} is not linked"]
