"""Where the vehicle was, as far as a recording tells: poses, velocities along a heading, a heading, or nothing."""

from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from typing import Dict, List, Optional, Tuple

import numpy as np

from dead_reckoning.dead_reckoner import DeadReckoner, DeadReckoningParameters, VelocitySource
from dead_reckoning.velocity_messages import VELOCITY_TYPES
from node_support.errors import RefusedInput
from recordings.bags.bag import Bag, RecordingError, missing_topic
from recordings.bags.topic_roles import ODOMETRY, Role, with_role
from recordings.motion.frame_tree import FrameTree, frame_name, frame_tree, heading_track, pose_track
from recordings.motion.pose_track import PoseTrack

_NO_SHIFT, _NO_TURN = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])


class MotionSource(Enum):
    """What is known of the motion."""

    POSES = "poses"
    VELOCITY = "velocity and heading"
    HEADING = "heading only"
    STANDING = "declared as standing"
    UNKNOWN = "declared as unknown"
    UNSAID = "not recorded"


@dataclass(frozen=True)
class MotionNames:
    """How the motion is called in a recording.

    odometry: topic with poses, to be used instead of tf; None: tf, and where it does not link the frames the likeliest
    topic. declared: STANDING or UNKNOWN where the user says so; then no poses of the recording are used. z_is_down:
    poses count x north, y east, z down; they are turned into x, y left, z up (REP-103).
    """

    odom_frame: str = "odom"
    base_frame: str = "base_link"
    odometry: Optional[str] = None
    declared: Optional[MotionSource] = None
    z_is_down: bool = False

    def upward(self, track: PoseTrack) -> PoseTrack:
        """Return poses that are counted as those of the recording with z up."""
        return track.turned_up() if self.z_is_down else track


@dataclass(frozen=True)
class Motion:
    """tree: links `odom_frame`, `base_frame` and the frames of the recording. notes: what was assumed, as sentences."""

    tree: FrameTree
    source: MotionSource
    notes: List[str] = field(default_factory=list)


def motion_of_bag(bag: Bag, names: MotionNames, truth: Optional[str] = None) -> Motion:
    """Return the motion that a bag tells, UNSAID where nothing in it moves; its topic `truth` is not used.

    Raises RecordingError where something moves, but nothing that is known to be the vehicle.
    """
    tree = frame_tree(bag)
    if names.declared is not None:
        return declared_motion(tree, names)
    link = (names.odom_frame, names.base_frame)
    if names.odometry is None and tree.links_between(*link) is not None:
        turned = tree.with_track(*link, names.upward(tree.tracks[link])) if link in tree.tracks else tree
        return Motion(turned, MotionSource.POSES)
    topic = names.odometry or _likeliest(bag, Role.ODOMETRY, truth)
    if topic is not None and not _is_of_velocities(bag, topic):
        return _of_poses(bag, tree, topic, names)
    velocity = topic or _likeliest(bag, Role.VELOCITY, truth)
    if velocity is not None:
        return _of_velocity(bag, tree, velocity, names)
    topic = _likeliest(bag, Role.HEADING, truth)
    if topic is not None:
        return _of_heading(bag, tree, topic, names)
    if tree.moving_stamps.size:
        raise RecordingError(_nothing(bag, tree, names))
    return unsaid_motion(tree, names, ", ".join(sorted(bag.topics)) or "no topics")


def unsaid_motion(tree: FrameTree, names: MotionNames, held: str) -> Motion:
    """Return one pose for ever, for a recording of which only what is `held` is known; echoes may tell more."""
    note = (
        f"nothing says where the vehicle was, there are {held}: the echoes tell whether it moved; --vehicle FILE, "
        "--standing and --unknown-motion tell more"
    )
    fixed = linked(tree, names, PoseTrack.fixed(_NO_SHIFT, _NO_TURN))
    return Motion(fixed, MotionSource.UNSAID, [note])


def declared_motion(tree: FrameTree, names: MotionNames) -> Motion:
    """Return the motion of a vehicle that did not move, or of whose motion nothing is known: one pose for ever."""
    return Motion(linked(tree, names, PoseTrack.fixed(_NO_SHIFT, _NO_TURN)), names.declared)


def linked(tree: FrameTree, names: MotionNames, track: PoseTrack) -> FrameTree:
    """Return a tree whose vehicle moves as `track` alone, poses of the base frame in odom."""
    base_links = {link: one for link, one in tree.tracks.items() if link[1] != names.base_frame}
    return FrameTree(base_links).with_track(names.odom_frame, names.base_frame, track)


def _of_poses(bag: Bag, tree: FrameTree, topic: str, names: MotionNames) -> Motion:
    if topic not in bag.topics:
        raise missing_topic(topic, [bag])
    messages = [message for _, message in bag.messages(topic)]
    try:
        track = pose_track(messages)
    except AttributeError:
        kind = bag.topics[topic].type
        raise RecordingError(
            f"{topic} holds {kind}, must be Odometry, PoseStamped or PoseWithCovarianceStamped"
        ) from None
    if not len(track):
        raise RecordingError(f"none of the {len(messages)} messages of {topic} holds a pose with a rotation")
    tree = linked(tree, names, names.upward(track))
    child = frame_name(getattr(messages[0], "child_frame_id", ""))
    if child and child != names.base_frame and names.base_frame not in frame_tree(bag).frames:
        tree = tree.with_track(names.base_frame, child, PoseTrack.fixed(_NO_SHIFT, _NO_TURN))
    said = "" if names.odometry else f", because tf does not link {names.odom_frame} and {names.base_frame}"
    return Motion(tree, MotionSource.POSES, [f"odometry from {topic} ({bag.topics[topic].type}){said}"])


def _of_heading(bag: Bag, tree: FrameTree, topic: str, names: MotionNames) -> Motion:
    track = _headings(bag, tree, topic, names)
    if track is None:
        raise RecordingError(f"{_nothing(bag, tree, names)}; {topic} holds no orientation either")
    note = f"no odometry: heading from {topic} ({bag.topics[topic].type}), the position is unknown"
    return Motion(linked(tree, names, names.upward(track)), MotionSource.HEADING, [note])


def _of_velocity(bag: Bag, tree: FrameTree, topic: str, names: MotionNames) -> Motion:
    """Return the motion that velocities make along the headings of another topic, or of their own."""
    candidates = [*(one.name for one in with_role(bag.topics, Role.HEADING)), topic]
    tracks = ((name, _headings(bag, tree, name, names)) for name in candidates)
    heading, headings = next(((name, track) for name, track in tracks if track is not None), (None, None))
    if headings is None:
        raise RecordingError(f"{_nothing(bag, tree, names)}; {topic} holds velocities, but no topic holds a heading")
    found, refused = _velocities(bag, topic, tree, names)
    if not found:
        raise RecordingError(f"none of the {refused} messages of {topic} holds a velocity")
    longest_gap = float(np.diff([stamp_ns for stamp_ns, *_ in found]).max(initial=0)) * 1e-9
    note = (
        f"odometry from {len(found)} velocities of {topic} ({bag.topics[topic].type}) along the heading of "
        f"{heading}; they are at most {longest_gap:.1f} s apart, and {refused} messages hold none"
    )
    return Motion(linked(tree, names, _reckoned(found, names.upward(headings))), MotionSource.VELOCITY, [note])


def _is_of_velocities(bag: Bag, topic: str) -> bool:
    """Return whether a topic holds velocities and no positions, or an Odometry whose positions are not filled in."""
    kind = bag.topics[topic].type if topic in bag.topics else ""
    if kind != ODOMETRY or kind not in VELOCITY_TYPES:
        return kind in VELOCITY_TYPES
    messages = [message for _, message in bag.messages(topic)]
    places = np.array([[one.pose.pose.position.x, one.pose.pose.position.y] for one in messages])
    speeds = [max(abs(one.twist.twist.linear.x), abs(one.twist.twist.linear.y)) for one in messages]
    return bool(messages) and not np.any(places) and max(speeds) > 0.0


def _headings(bag: Bag, tree: FrameTree, topic: str, names: MotionNames) -> Optional[PoseTrack]:
    """Return the vehicle's orientations at the origin, by the mount that tf tells; None for a topic that holds none."""
    messages = [message for _, message in bag.messages(topic)]
    try:
        track = heading_track(messages)
    except AttributeError:
        return None
    if not len(track):
        return None
    mount = _fixed_pose(tree, names.base_frame, frame_name(messages[0].header.frame_id))
    return track if mount is None or hasattr(messages[0], "pose") else track.mounted(mount)


def _likeliest(bag: Bag, role: Role, truth: Optional[str]) -> Optional[str]:
    return next((topic.name for topic in with_role(bag.topics, role) if topic.name != truth), None)


def _nothing(bag: Bag, tree: FrameTree, names: MotionNames) -> str:
    topics = ", ".join(sorted(bag.topics)) or "none at all"
    reason = tree.why_not(names.odom_frame, names.base_frame, np.zeros(0, dtype=np.int64))
    tf = f"tf does not say where the vehicle was: {reason}" if tree.tracks else "no /tf"
    return (
        f"{tf}; and no topic holds odometry (Odometry, PoseStamped), so nothing says where the beams were taken; "
        f"there are {topics}; if the vehicle stood still, give --standing; if it moved, --unknown-motion"
    )


_Velocity = Tuple[int, np.ndarray, np.ndarray]
"""Stamp, ns; (3,) m/s along the vehicle's axes; (2,) m, place of the instrument."""


def _velocities(bag: Bag, topic: str, tree: FrameTree, names: MotionNames) -> Tuple[List[_Velocity], int]:
    """Return what a topic of one of `VELOCITY_TYPES` says, sorted by time, and how many messages say nothing.

    tree: tells how the instrument is mounted; one that it does not place is taken as mounted straight at the origin.
    """
    kind = VELOCITY_TYPES[bag.topics[topic].type]
    rows: List[_Velocity] = []
    mounts: Dict[str, Optional[np.ndarray]] = {names.base_frame: None}
    refused = 0
    for time, message in bag.messages(topic):
        try:
            fields = kind.fields(message)
        except RefusedInput:
            refused += 1
            continue
        if fields.frame_id not in mounts:
            mounts[fields.frame_id] = _fixed_pose(tree, names.base_frame, fields.frame_id)
        rows.append((fields.stamp_ns or time, *kind.in_vehicle(fields, mounts[fields.frame_id], names.z_is_down)))
    return sorted(rows, key=lambda row: row[0]), refused


def _fixed_pose(tree: FrameTree, target: str, source: str) -> Optional[np.ndarray]:
    """Return T_target_source (4, 4), which does not change; None where the tree does not link the frames."""
    if tree.links_between(target, source) is None:
        return None
    return tree.poses(target, source, np.zeros(1, dtype=np.int64))[0][0]


def _reckoned(velocities: List[_Velocity], headings: PoseTrack) -> PoseTrack:
    """Return T_odom_base at the stamps of headings (n > 0), from (0, 0)."""
    reckoner = DeadReckoner(DeadReckoningParameters(velocity_source=VelocitySource.MEASURED))
    rotations = headings.at(headings.stamps_ns)[:, :3, :3]
    positions, waiting = np.empty((len(headings), 3)), deque(velocities)
    for index, stamp_ns in enumerate(map(int, headings.stamps_ns)):
        while waiting and waiting[0][0] <= stamp_ns:
            with suppress(RefusedInput):
                reckoner.take_velocity(*waiting.popleft())
        positions[index] = reckoner.take_orientation(stamp_ns, rotations[index]).T_odom_base[:3, 3]
    return PoseTrack(headings.stamps_ns, positions, headings.rotations)
