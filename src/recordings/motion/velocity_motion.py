"""The vehicle's way from measured velocities and headings, by the core of the node dead_reckoning."""

from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from dead_reckoning.dead_reckoner import DeadReckoner, DeadReckoningParameters, VelocitySource
from dead_reckoning.velocity_messages import VELOCITY_TYPES
from node_support.errors import RefusedInput
from recordings.bags.bag import Bag
from recordings.motion.frame_tree import FrameTree
from recordings.motion.pose_track import PoseTrack


class Velocities(NamedTuple):
    """stamps_ns: (n,) increasing. values: (n, 3) m/s along the vehicle's axes. places: (n, 2) m, of the instrument.

    refused: how many messages said none.
    """

    stamps_ns: np.ndarray
    values: np.ndarray
    places: np.ndarray
    refused: int

    @property
    def longest_gap(self) -> float:
        """Longest time between two of them, s."""
        return float(np.diff(self.stamps_ns).max()) * 1e-9 if len(self.stamps_ns) > 1 else 0.0


def velocities_of(bag: Bag, topic: str, tree: FrameTree, base_frame: str, is_downward: bool) -> Velocities:
    """Return what a topic of one of `VELOCITY_TYPES` says; may be empty.

    tree: tells how the instrument is mounted; one that it does not place is taken as mounted straight at the origin.
    is_downward: axes of the vehicle's own frame count ahead, right, down.
    """
    kind = VELOCITY_TYPES[bag.topics[topic].type]
    rows: List[Tuple[int, np.ndarray, np.ndarray]] = []
    mounts: Dict[str, Optional[np.ndarray]] = {}
    refused = 0
    for time, message in bag.messages(topic):
        try:
            fields = kind.fields(message)
        except RefusedInput:
            refused += 1
            continue
        if fields.frame_id not in mounts:
            mounts[fields.frame_id] = fixed_pose(tree, base_frame, fields.frame_id)
        mount = mounts[fields.frame_id]
        if mount is None or fields.frame_id == base_frame:
            value, place = kind.in_vehicle(fields, is_downward), np.zeros(2)
        else:
            value, place = mount[:3, :3] @ fields.velocity, mount[:2, 3]
        rows.append((fields.stamp_ns or time, value, place))
    rows.sort(key=lambda row: row[0])
    stamps, values, places = zip(*rows) if rows else ((), (), ())
    return Velocities(
        np.array(stamps, dtype=np.int64), np.array(values).reshape(-1, 3), np.array(places).reshape(-1, 2), refused
    )


def fixed_pose(tree: FrameTree, target: str, source: str) -> Optional[np.ndarray]:
    """Return T_target_source (4, 4), which does not change; None where the tree does not link the frames."""
    if tree.links_between(target, source) is None:
        return None
    return tree.poses(target, source, np.zeros(1, dtype=np.int64))[0][0]


def reckoned(velocities: Velocities, headings: PoseTrack) -> PoseTrack:
    """Return T_odom_base at the stamps of headings (n > 0), from (0, 0)."""
    reckoner = DeadReckoner(DeadReckoningParameters(velocity_source=VelocitySource.MEASURED))
    rotations = headings.at(headings.stamps_ns)[:, :3, :3]
    positions, following = np.empty((len(headings), 3)), 0
    for index, stamp_ns in enumerate(map(int, headings.stamps_ns)):
        while following < len(velocities.stamps_ns) and velocities.stamps_ns[following] <= stamp_ns:
            _take(reckoner, velocities, following)
            following += 1
        positions[index] = reckoner.take_orientation(stamp_ns, rotations[index]).T_odom_base[:3, 3]
    return PoseTrack(headings.stamps_ns, positions, headings.rotations)


def _take(reckoner: DeadReckoner, velocities: Velocities, index: int) -> None:
    try:
        reckoner.take_velocity(int(velocities.stamps_ns[index]), velocities.values[index], velocities.places[index])
    except RefusedInput:
        return
