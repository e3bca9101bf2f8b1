"""Writes a recording as a bag of ROS 1 that our nodes play and map_bag reads."""

from pathlib import Path
from typing import Any, Iterator, List, Tuple

import numpy as np

from node_support import topics
from node_support.files import whole_file
from recordings.bags.bag_writer import BagWriter
from recordings.reading.reader import Read, Request
from recordings.transforms.frame_tree import Link
from recordings.transforms.pose_track import PoseTrack
from sonar_processing.beams.beam import Beam

_BEAMS = f"/{topics.BEAMS}"
_ODOMETRY = f"/{topics.ODOMETRY}"
_TRUTH = f"/{topics.GROUND_TRUTH}"
_Told = Tuple[int, str, Any]


def write_converted(path: Path, held: Read, request: Request) -> None:
    """Write beams, odometry, transforms and truth, whole or not at all. Raises OSError."""
    with whole_file(path) as temporary, BagWriter(temporary) as bag:
        content = [*_beams(bag, held.found.beams), *_motion(bag, held, request), *_truth(bag, held)]
        content.sort(key=lambda one: one[0])
        start = content[0][0]
        bag.write(topics.STATIC_TRANSFORMS, _fixed_links(bag, held, start), start)
        for stamp_ns, topic, message in content:
            bag.write(topic, message, stamp_ns)


def _beams(bag: BagWriter, beams: List[Beam]) -> Iterator[_Told]:
    for beam in beams:
        message = _stamped(bag, "underwater_map_construction/SonarScanLine", beam.stamp_ns, beam.frame_id)
        message.angle, message.sensorAngle = beam.angle, beam.sensor_angle
        message.intensities = np.asarray(beam.intensities, dtype=np.uint8)
        message.range_resolution = beam.range_resolution
        message.maxrange_meters = beam.range_resolution * beam.intensities.size
        yield beam.stamp_ns, _BEAMS, message


def _motion(bag: BagWriter, held: Read, request: Request) -> Iterator[_Told]:
    tracks, names = held.motion.tree.tracks, request.motion
    for link, track in tracks.items():
        if not track.is_fixed:
            for index, stamp_ns in enumerate(map(int, track.stamps_ns)):
                yield stamp_ns, topics.TRANSFORMS, _transforms(bag, [_transform(bag, link, track, index, stamp_ns)])
    odometry = tracks.get((names.odom_frame, names.base_frame))
    if odometry is not None and not odometry.is_fixed:
        yield from _odometry(bag, _ODOMETRY, odometry, names.odom_frame, names.base_frame)


def _truth(bag: BagWriter, held: Read) -> Iterator[_Told]:
    return _odometry(bag, _TRUTH, held.truth, "map", "") if held.truth is not None else iter(())


def _odometry(bag: BagWriter, topic: str, track: PoseTrack, frame: str, child: str) -> Iterator[_Told]:
    for index in range(len(track)):
        stamp_ns = int(track.stamps_ns[index])
        message = _stamped(bag, "nav_msgs/Odometry", stamp_ns, frame)
        message.child_frame_id = child
        _fill(message.pose.pose.position, message.pose.pose.orientation, track, index)
        yield stamp_ns, topic, message


def _fixed_links(bag: BagWriter, held: Read, stamp_ns: int) -> Any:
    fixed = [(link, track) for link, track in held.motion.tree.tracks.items() if track.is_fixed]
    return _transforms(bag, [_transform(bag, link, track, 0, stamp_ns) for link, track in fixed])


def _transforms(bag: BagWriter, transforms: List[Any]) -> Any:
    message = bag.make("tf2_msgs/TFMessage")
    message.transforms = transforms
    return message


def _transform(bag: BagWriter, link: Link, track: PoseTrack, index: int, stamp_ns: int) -> Any:
    message = _stamped(bag, "geometry_msgs/TransformStamped", stamp_ns, link[0])
    message.child_frame_id = link[1]
    _fill(message.transform.translation, message.transform.rotation, track, index)
    return message


def _fill(place: Any, turn: Any, track: PoseTrack, index: int) -> None:
    place.x, place.y, place.z = track.translations[index]
    turn.x, turn.y, turn.z, turn.w = track.rotations[index]


def _stamped(bag: BagWriter, kind: str, stamp_ns: int, frame: str) -> Any:
    message = bag.make(kind)
    message.header.stamp, message.header.frame_id = bag.time(stamp_ns), frame
    return message
