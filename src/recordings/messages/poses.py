"""Poses and transforms of messages."""

from typing import Any, Dict, Iterable, List, Tuple

import numpy as np

from recordings.bags.bag import Bag
from recordings.transforms.frame_tree import FrameTree, Link
from recordings.transforms.pose_track import PoseTrack
from sonar_processing.messages.fields import stamp_ns

_MOVING, _FIXED = "/tf", "/tf_static"

_Sample = Tuple[int, Tuple[float, float, float], Tuple[float, float, float, float]]


def frame_tree(bag: Bag) -> FrameTree:
    """Return all transforms of a bag. A link on both topics counts as moving, as in tf2.

    Transforms without a frame, of a frame in itself, or that are no rotation are left out.
    """
    fixed = {
        link: PoseTrack(track.stamps_ns[:1], track.translations[:1], track.rotations[:1], is_fixed=True)
        for link, track in _links(message for _, message in bag.messages(_FIXED)).items()
        if len(track)
    }
    return FrameTree({**fixed, **_links(message for _, message in bag.messages(_MOVING))})


def pose_track(messages: Iterable[Any]) -> PoseTrack:
    """Return the poses of Odometry, PoseStamped or PoseWithCovarianceStamped messages; may be empty.

    Raises AttributeError for messages that have no pose.
    """
    return _track([_sample(message) for message in messages])


def heading_track(messages: Iterable[Any]) -> PoseTrack:
    """Return the orientations of Imu messages, at the origin; may be empty. Raises AttributeError for others."""
    return _track([(stamp_ns(one.header), (0.0, 0.0, 0.0), _rotation(one.orientation)) for one in messages])


def frame_name(name: str) -> str:
    """Return the name of a frame without the slash of ROS before Hydro."""
    return name.lstrip("/")


def _links(messages: Iterable[Any]) -> Dict[Link, PoseTrack]:
    samples: Dict[Link, List[_Sample]] = {}
    for message in messages:
        for one in message.transforms:
            link = frame_name(one.header.frame_id), frame_name(one.child_frame_id)
            if all(link) and link[0] != link[1]:
                pose = _vector(one.transform.translation), _rotation(one.transform.rotation)
                samples.setdefault(link, []).append((stamp_ns(one.header), *pose))
    return {link: _track(found) for link, found in samples.items()}


def _sample(message: Any) -> _Sample:
    pose = getattr(message.pose, "pose", message.pose)
    return stamp_ns(message.header), _vector(pose.position), _rotation(pose.orientation)


def _track(samples: List[_Sample]) -> PoseTrack:
    stamps, translations, rotations = zip(*samples) if samples else ((), (), ())
    return PoseTrack.sorted_from(np.array(stamps, dtype=np.int64), np.array(translations), np.array(rotations))


def _vector(value: Any) -> Tuple[float, float, float]:
    return value.x, value.y, value.z


def _rotation(value: Any) -> Tuple[float, float, float, float]:
    return value.x, value.y, value.z, value.w
