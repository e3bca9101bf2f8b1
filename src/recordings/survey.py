"""Everything that can be said of a bag before its beams are read, and the same in words."""

import re
import shlex
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy as np

from node_support.errors import RefusedInput
from recordings.bags.bag import Bag, RecordingError, Topic
from recordings.bags.topic_roles import Role, with_role
from recordings.beams import RecordedBeams, beam_topic
from recordings.makers_logs import is_makers_log
from recordings.motion.frame_tree import FrameTree, frame_tree
from recordings.motion.pose_track import PoseTrack
from recordings.motion.vehicle_motion import Motion, MotionSource, motion_of_bag
from recordings.reader import Request, mounted, tried
from sonar_processing.messages.reader import BeamReader

_NED = re.compile(r"(^|[_/])(ned|frd)($|[_/])")
_IMU_MESSAGES = 200  # that are looked at; a vehicle does not pitch for that long
_HALF_GRAVITY = 4.9  # m/s^2, as a level vehicle's z axis feels it

_DECLARED = {MotionSource.STANDING: "--standing", MotionSource.UNKNOWN: "--unknown-motion"}
_SHOWN = (Role.BEAMS, Role.ODOMETRY, Role.HEADING, Role.DEPTH, Role.VELOCITY, Role.POSITION)


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
            f"{path}: the log of a sonar holds beams only; give the motion with --vehicle, or --standing, or "
            "--unknown-motion"
        )
    with Bag(path) as bag:
        tree = frame_tree(bag)
        missing: List[str] = []
        assumed: List[str] = []
        topic = tried(missing, lambda: beam_topic(bag, request.beams))
        motion = tried(missing, lambda: motion_of_bag(bag, request.motion, request.truth))
        if motion is not None:
            assumed += motion.notes
        if topic is not None:
            first = _first_beams(bag, topic, request)
            assumed += first.notes
            missing += [] if first.beams else [f"none of the first messages of {topic} holds a beam that can be used"]
            if motion is not None and first.beams:
                _look_at_place(motion, first, request, assumed, missing)
        signs = _signs_of_z_down(bag, tree.frames)
        if signs and not request.motion.z_is_down:
            assumed.append("the odometry counts x, y left, z up; if it counts north, east, down, give --ned")
        topics = {role: with_role(bag.topics, role) for role in Role}
        return Survey(path, bag.is_ros2, topics, tree, topic, signs, assumed, missing)


def _first_beams(bag: Bag, topic: str, request: Request) -> RecordedBeams:
    """Return the beams of the first message that holds some."""
    reader = BeamReader(request.parameters)
    for _, message in bag.messages(topic):
        try:
            reading = reader.read(bag.topics[topic].type, message)
        except RefusedInput:
            continue
        return RecordedBeams(reading.beams, [False] * len(reading.beams), notes=reading.notes)
    return RecordedBeams([], [])


def _look_at_place(
    motion: Motion, first: RecordedBeams, request: Request, assumed: List[str], missing: List[str]
) -> None:
    tree, notes = mounted(motion.tree, request.motion.base_frame, first, request.parameters)
    assumed += notes
    beam, names = first.beams[0], request.motion
    link = tree.tracks.get((names.odom_frame, names.base_frame))
    if link is not None and not link.covers(np.array([beam.stamp_ns])).any():
        reason = tree.why_not(names.odom_frame, beam.frame_id, np.array([beam.stamp_ns]))
        assumed.append(f"the first beams are left out: {reason}")
    missing += (
        []
        if tree.links_between(names.odom_frame, beam.frame_id) is not None
        else [f"no transforms link {beam.frame_id} and {names.odom_frame}"]
    )


def _signs_of_z_down(bag: Bag, frames: List[str]) -> List[str]:
    """Return one sentence for each sign that frames count north, east, down, or forward, right, down."""
    named = [name for name in [*frames, *bag.topics] if _NED.search(name.lower())]
    signs = [f"{', '.join(sorted(named))}: named so"] if named else []
    for topic in with_role(bag.topics, Role.HEADING):
        felt = _gravity(bag, topic.name)
        if felt is not None and felt < -_HALF_GRAVITY:
            signs.append(f"{topic.name} feels gravity along -z, {felt:.1f} m/s2: its frame has z down")
    return signs


def _gravity(bag: Bag, topic: str) -> Optional[float]:
    """Return what the z axis of an Imu feels on average, m/s^2; None for another type or without messages."""
    found = [_felt(message) for _, message in islice(bag.messages(topic), _IMU_MESSAGES)]
    known = [value for value in found if value is not None and np.isfinite(value)]
    return float(np.mean(known)) if known else None


def _felt(message: Any) -> Optional[float]:
    acceleration = getattr(message, "linear_acceleration", None)
    return None if acceleration is None else acceleration.z


def report(survey: Survey, request: Request) -> str:
    """Return what a bag holds, what will be assumed, what is missing, and a command line to start with."""
    lines = [f"{survey.path}: a bag of ROS {2 if survey.is_ros2 else 1}"]
    for role in _SHOWN:
        lines_of_role = [f"{topic.name} ({topic.type}, {topic.count} messages)" for topic in survey.topics[role]]
        lines += _section(role.value, lines_of_role or ["none"])
    links = [
        f"{parent} -> {child}: {_known_time(track)}" for (parent, child), track in sorted(survey.tree.tracks.items())
    ]
    lines += _section("frames", links or ["none"])
    lines += _section("signs of z down", survey.z_down or ["none"])
    lines += _section("assumed", survey.assumed or ["nothing"])
    lines += _section("missing", survey.missing or ["nothing"])
    if not survey.missing:
        lines += _section("start with", [_command(survey, request)])
    return "\n".join(lines)


def _section(title: str, lines: List[str]) -> List[str]:
    return [f"{title}:", *(f"    {line}" for line in lines)]


def _known_time(track: PoseTrack) -> str:
    if track.is_fixed:
        return "fixed"
    first, last = track.stamps_ns[[0, -1]] * 1e-9
    return f"{len(track)} poses from {first:.2f} to {last:.2f} s"


def _command(survey: Survey, request: Request) -> str:
    motion = request.motion
    words = ["map_bag", str(survey.path), "--out", f"{survey.path.stem}_map", "--beams", survey.beams or ""]
    words += ["--odometry-topic", motion.odometry] if motion.odometry else []
    words += [_DECLARED[motion.declared]] if motion.declared is not None else []
    words += ["--ned"] if motion.z_is_down else []
    words += ["--odom-frame", motion.odom_frame] if motion.odom_frame != "odom" else []
    words += ["--base-frame", motion.base_frame] if motion.base_frame != "base_link" else []
    return " ".join(shlex.quote(word) for word in words)
