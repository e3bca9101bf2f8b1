"""Reads what map_bag needs from a bag."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from mlsm_manager.matching.problem.scan import Track
from mlsm_manager.offline.recording import Recording, Truth
from node_support.errors import RefusedInput
from recordings.bags.bag import Bag
from recordings.errors import RecordingError
from recordings.messages.beams import beam_of
from recordings.messages.poses import TRANSFORM_TOPICS, frame_tree, pose_track
from recordings.transforms.frame_tree import FrameTree
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.scans.moving_state import MovingState
from sonar_processing.scans.parameters import SonarToCloudParameters

_VELOCITY_TOPIC = "/cmd_vel"


@dataclass(frozen=True)
class BagNames:
    """What is called how in a bag.

    truth: topic of the true pose (Odometry or PoseStamped), or None. z_is_down: odometry and truth count x north, y
    east, z down; they are turned into x, y left, z up (REP-103).
    """

    beams: str
    odom_frame: str
    base_frame: str
    truth: Optional[str]
    z_is_down: bool = False


def read_recording(path: Path, names: BagNames) -> Recording:
    """Return the recording of a bag; raises RecordingError for one that cannot be used."""
    with Bag(path) as bag:
        _check_topics(bag, names)
        tree = _tree(bag, names)
        beams, moving, refused = _beams(bag, names)
        stamps = tree.moving_stamps
        if not stamps.size:
            # A vehicle that never moves may have fixed transforms only.
            stamps = np.unique([beam.stamp_ns for beam in beams])
        track = _track(tree, stamps, path, names)
        placed, unplaced = _placed(beams, moving, tree, path, names)
        truth = _truth(bag, names) if names.truth else None
        return Recording(placed, refused + unplaced, track, truth)


def _check_topics(bag: Bag, names: BagNames) -> None:
    topics = ", ".join(sorted(bag.topics))
    for topic in [names.beams, *([names.truth] if names.truth else [])]:
        if topic not in bag.topics:
            raise RecordingError(f"{bag.path}: no topic {topic}; there are {topics or 'none at all'}")
    if not any(topic in bag.topics for topic in TRANSFORM_TOPICS):
        raise RecordingError(f"{bag.path}: no /tf, so nothing tells where the beams were taken; there are {topics}")


def _tree(bag: Bag, names: BagNames) -> FrameTree:
    tree, link = frame_tree(bag), (names.odom_frame, names.base_frame)
    if names.z_is_down and link in tree.tracks:
        return tree.with_track(*link, tree.tracks[link].turned_up())
    return tree


def _track(tree: FrameTree, stamps: np.ndarray, path: Path, names: BagNames) -> Track:
    frames = names.odom_frame, names.base_frame
    poses, known = _poses(tree, *frames, stamps)
    if np.count_nonzero(known) < 2:
        reason = tree.why_not(*frames, stamps) or "a single stamp"
        raise RecordingError(f"{path}: no odometry, tf from {names.base_frame} to {names.odom_frame}: {reason}")
    poses = poses[known]
    yaws = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    return Track(stamps[known] * 1e-9, np.column_stack([poses[:, :2, 3], yaws]))


def _poses(tree: FrameTree, target: str, source: str, stamps: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    if tree.way(target, source) is None:
        return np.zeros((len(stamps), 4, 4)), np.zeros(len(stamps), dtype=bool)
    return tree.poses(target, source, stamps)


def _beams(bag: Bag, names: BagNames) -> Tuple[List[Beam], List[bool], int]:
    """Return the beams, whether the vehicle moved at each of them, and how many could not be used."""
    moving_state, parameters = MovingState(), SonarToCloudParameters()
    velocities = bag.messages(_VELOCITY_TOPIC)
    velocity = next(velocities, None)
    beams, moving, refused = [], [], 0
    for time, message in list(bag.messages(names.beams)):
        while velocity is not None and velocity[0] <= time:
            _take_velocity(moving_state, velocity[1])
            velocity = next(velocities, None)
        try:
            beams.append(beam_of(message))
        except RefusedInput:
            refused += 1
            continue
        moving.append(moving_state.is_moving(parameters))
    return beams, moving, refused


def _take_velocity(moving_state: MovingState, message: Any) -> None:
    twist = message if hasattr(message, "linear") else message.twist
    linear, angular = twist.linear, twist.angular
    with suppress(RefusedInput):
        moving_state.take((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))


def _placed(
    beams: List[Beam], moving: List[bool], tree: FrameTree, path: Path, names: BagNames
) -> Tuple[List[PlacedBeam], int]:
    """Return the beams with their places, in the order of their stamps, and how many have none."""
    of_frame: Dict[str, List[int]] = {}
    for index, beam in enumerate(beams):
        of_frame.setdefault(beam.frame_id, []).append(index)
    placed = []
    for frame, indices in of_frame.items():
        stamps = np.array([beams[index].stamp_ns for index in indices])
        poses, known = _poses(tree, names.odom_frame, frame, stamps)
        placed += [
            (index, PlacedBeam(beams[index], pose, moving[index]))
            for index, pose, kept in zip(indices, poses, known)
            if kept
        ]
    if not placed:
        reasons = [tree.why_not(names.odom_frame, beam.frame_id, np.array([beam.stamp_ns])) for beam in beams[:1]]
        told = reasons[0] if reasons else "none can be used"
        raise RecordingError(f"{path}: none of {len(beams)} beams could be placed in {names.odom_frame}: {told}")
    placed.sort(key=lambda one: (one[1].beam.stamp_ns, one[0]))
    return [one for _, one in placed], len(beams) - len(placed)


def _truth(bag: Bag, names: BagNames) -> Truth:
    try:
        track = pose_track(message for _, message in bag.messages(names.truth))
    except AttributeError:
        kind = bag.topics[names.truth].type
        raise RecordingError(f"{bag.path}: {names.truth} holds {kind}, must be Odometry or PoseStamped") from None
    track = track.turned_up() if names.z_is_down else track
    return Truth(track.stamps_ns * 1e-9, track.translations[:, :2])
