"""A recording of any kind as map_bag needs it."""

from pathlib import Path
from typing import Dict, List, Tuple

import numpy as np

from mlsm_manager.offline.recording import Recording, Truth
from mlsm_manager.scan_matching.scan import Track
from recordings.bags.bag import RecordingError
from recordings.beams import RecordedBeams
from recordings.motion.frame_tree import FrameTree
from recordings.motion.pose_track import PoseTrack
from recordings.reader import Request, read
from sonar_processing.beams.beam import PlacedBeam


def read_recording(path: Path, request: Request) -> Recording:
    """Return a recording; raises RecordingError for one that cannot be used."""
    content = read(path, request)
    tree, recorded = content.motion.tree, content.recorded
    stamps = tree.moving_stamps
    if not stamps.size:
        # A vehicle that never moves may have fixed transforms only.
        stamps = np.unique(recorded.stamps_ns)
    track = _track(tree, stamps, path, request)
    placed, unplaced = _placed(recorded, tree, path, request)
    truth = None if content.truth is None else _truth(content.truth)
    return Recording(placed, recorded.refused + unplaced, track, truth, content.notes)


def _track(tree: FrameTree, stamps: np.ndarray, path: Path, request: Request) -> Track:
    frames = request.motion.odom_frame, request.motion.base_frame
    poses, known = tree.poses(*frames, stamps)
    if np.count_nonzero(known) < 2:
        reason = tree.why_not(*frames, stamps) or "a single stamp"
        raise RecordingError(f"{path}: no odometry, tf from {frames[1]} to {frames[0]}: {reason}")
    poses = poses[known]
    yaws = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    return Track(stamps[known] * 1e-9, np.column_stack([poses[:, :2, 3], yaws]))


def _placed(recorded: RecordedBeams, tree: FrameTree, path: Path, request: Request) -> Tuple[List[PlacedBeam], int]:
    """Return the beams with their places, in the order of their stamps, and how many have none."""
    odom, stamps = request.motion.odom_frame, recorded.stamps_ns
    of_frame: Dict[str, List[int]] = {}
    for index, beam in enumerate(recorded.beams):
        of_frame.setdefault(beam.frame_id, []).append(index)
    placed = {}
    for frame, indices in of_frame.items():
        poses, known = tree.poses(odom, frame, stamps[indices])
        for index, pose, is_known in zip(indices, poses, known):
            if is_known:
                placed[index] = PlacedBeam(recorded.beams[index], pose, recorded.moving[index])
    if not placed:
        reason = tree.why_not(odom, recorded.beams[0].frame_id, stamps)
        raise RecordingError(f"{path}: none of {len(stamps)} beams could be placed in {odom}: {reason}")
    order = sorted(placed, key=lambda index: (stamps[index], index))
    return [placed[index] for index in order], len(stamps) - len(placed)


def _truth(track: PoseTrack) -> Truth:
    return Truth(track.stamps_ns * 1e-9, track.translations[:, :2])
