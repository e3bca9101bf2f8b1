"""Tracks with other steps, positions or headings than an odometry reported."""

from enum import Enum

import numpy as np

from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import rotated, seen_from


def integrated(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return poses (m, 3) from `start` (3,) on by `steps` (m - 1, 3), each in the vehicle's frame."""
    yaws = start[2] + np.append(0.0, np.cumsum(steps[:, 2]))
    moves = (steps[:, 0] + 1j * steps[:, 1]) * np.exp(1j * yaws[:-1])
    places = complex(*start[:2]) + np.append(0.0, np.cumsum(moves))
    return np.column_stack([places.real, places.imag, yaws])


class Mirror(Enum):
    """Of what y counts the other way: of positions in odom, or of moves in the vehicle's frame."""

    NOTHING = "nothing"
    POSITIONS = "positions"
    MOVES = "moves"

    def of(self, track: Track) -> Track:
        """Return a track without it, or with it; it begins where it began, and headings stay."""
        if self is Mirror.NOTHING:
            return track
        start, signs = track.poses[0], np.array([1.0, -1.0, 1.0])
        if self is Mirror.MOVES:
            return track.with_poses(integrated(start, signs * seen_from(track.poses[:-1], track.poses[1:])))
        return track.with_poses(np.append(start[:2], 0.0) + signs * (track.poses - np.append(start[:2], 0.0)))


def with_positions_turned(track: Track, turn: float, begin: float = -np.inf) -> Track:
    """Return a track whose positions are turned by `turn` [rad] about that at `begin` [s]; headings stay, and what was
    before.
    """
    start = track.at(max(begin, track.times[0]))[:2]
    gone = rotated(track.poses[:, :2] - start, np.where(track.times >= begin, turn, 0.0))
    return track.with_poses(np.column_stack([start + gone, track.poses[:, 2]]))


def with_headings_reversed(track: Track, are_reckoned: bool) -> Track:
    """Return a track whose headings count the other way; are_reckoned: positions follow from moves and headings."""
    poses = track.poses * [1.0, 1.0, -1.0]
    if not are_reckoned:
        return track.with_poses(poses)
    steps = seen_from(track.poses[:-1], track.poses[1:]) * [1.0, 1.0, -1.0]
    return track.with_poses(integrated(poses[0], steps))
