"""How frames are linked, the pose of any of them in any other, and the poses that messages hold."""

from collections import deque
from typing import Any, Dict, Iterable, List, Optional, Tuple

import numpy as np

from node_support import topics
from node_support.headers import stamp_ns
from recordings.bags.bag import Bag
from recordings.motion.pose_track import PoseTrack

Link = Tuple[str, str]  # parent and child

_KNOWN = (0.0,)  # Covariance; its first value is -1 where an Imu measures no orientation (sensor_msgs/Imu)
_Sample = Tuple[int, Tuple[float, float, float], Tuple[float, float, float, float]]


class FrameTree:
    """Poses of frames in their parents, by (parent, child).

    Links may form any graph; of several chains the shortest counts. tf2 knows one parent per frame; bags of several
    publishers often hold more.
    """

    def __init__(self, tracks: Optional[Dict[Link, PoseTrack]] = None) -> None:
        self.tracks: Dict[Link, PoseTrack] = {link: track for link, track in (tracks or {}).items() if len(track)}

    @property
    def frames(self) -> List[str]:
        return sorted({frame for link in self.tracks for frame in link})

    @property
    def moving_stamps(self) -> np.ndarray:
        """(n,) ns, increasing: all stamps of poses that change."""
        moving = [track.stamps_ns for track in self.tracks.values() if not track.is_fixed]
        return np.unique(np.concatenate(moving)) if moving else np.zeros(0, dtype=np.int64)

    def with_track(self, parent: str, child: str, track: PoseTrack) -> "FrameTree":
        """Return a tree that has one more link, or another track for it."""
        return FrameTree({**self.tracks, (parent, child): track})

    def links_between(self, target: str, source: str) -> Optional[List[Link]]:
        """Return the links from `target` to `source`, each as it is passed; None where the two are not linked."""
        if target == source:
            return []
        came_from: Dict[str, str] = {target: target}
        waiting = deque([target])
        while waiting:
            frame = waiting.popleft()
            linked = (link for link in self.tracks if frame in link)
            for neighbour in (child if parent == frame else parent for parent, child in linked):
                if neighbour not in came_from:
                    came_from[neighbour] = frame
                    waiting.append(neighbour)
        if source not in came_from:
            return None
        links, frame = [], source
        while frame != target:
            links.append((came_from[frame], frame))
            frame = came_from[frame]
        return links[::-1]

    def poses(self, target: str, source: str, stamps_ns: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return T_target_source (k, 4, 4) at stamps (k,), and (k,) whether every link is known then.

        Where one is not known, its nearest pose stands. Raises KeyError when the frames are not linked.
        """
        links = self.links_between(target, source)
        if links is None:
            raise KeyError(self.why_not(target, source, stamps_ns))
        result = np.tile(np.eye(4), (len(stamps_ns), 1, 1))
        known = np.ones(len(stamps_ns), dtype=bool)
        for step in links:
            link, is_down = self._link(step)
            poses = self.tracks[link].at(stamps_ns)
            result = result @ (poses if is_down else np.linalg.inv(poses))
            known &= self.tracks[link].covers(stamps_ns)
        return result, known

    def why_not(self, target: str, source: str, stamps_ns: np.ndarray) -> str:
        """Return in words why a pose of `source` in `target` is not known at all stamps (k,); empty where it is."""
        missing = [frame for frame in (source, target) if frame not in self.frames]
        if missing and source != target:
            return f"no transform names {' or '.join(missing)}; there are {', '.join(self.frames) or 'none'}"
        links = self.links_between(target, source)
        if links is None:
            return f"{source} and {target} are not linked"
        for step in links:
            (parent, child), _ = self._link(step)
            track = self.tracks[parent, child]
            outside = stamps_ns[~track.covers(stamps_ns)]
            if outside.size:
                first, last, asked = np.array([*track.stamps_ns[[0, -1]], outside[0]]) * 1e-9
                return f"{child} in {parent} is known from {first:.2f} to {last:.2f} s, not at {asked:.2f} s"
        return ""

    def _link(self, step: Link) -> Tuple[Link, bool]:
        """Return the link that a step passes, and whether it goes from parent to child."""
        return (step, True) if step in self.tracks else (step[::-1], False)


def frame_tree(bag: Bag) -> FrameTree:
    """Return all transforms of a bag. A link on both topics counts as moving, as in tf2.

    Transforms without a frame, of a frame in itself, or that are no rotation are left out.
    """
    fixed = {
        link: PoseTrack(track.stamps_ns[:1], track.translations[:1], track.rotations[:1], is_fixed=True)
        for link, track in _links(message for _, message in bag.messages(topics.STATIC_TRANSFORMS)).items()
        if len(track)
    }
    return FrameTree({**fixed, **_links(message for _, message in bag.messages(topics.TRANSFORMS))})


def pose_track(messages: Iterable[Any]) -> PoseTrack:
    """Return the poses of Odometry, PoseStamped or PoseWithCovarianceStamped messages; may be empty.

    Raises AttributeError for messages that have no pose.
    """
    poses = ((one.header, getattr(one.pose, "pose", one.pose)) for one in messages)
    return _track([(stamp_ns(header), _vector(pose.position), _rotation(pose.orientation)) for header, pose in poses])


def heading_track(messages: Iterable[Any]) -> PoseTrack:
    """Return the orientations of Imu or Odometry messages, at the origin; may be empty.

    Those of a device that says that it measures none are left out. Raises AttributeError for other messages.
    """
    poses = ((one.header, one.pose.pose if hasattr(one, "pose") else one) for one in messages)
    known = ((header, pose) for header, pose in poses if getattr(pose, "orientation_covariance", _KNOWN)[0] != -1.0)
    return _track([(stamp_ns(header), (0.0, 0.0, 0.0), _rotation(pose.orientation)) for header, pose in known])


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


def _track(samples: List[_Sample]) -> PoseTrack:
    stamps, translations, rotations = zip(*samples) if samples else ((), (), ())
    return PoseTrack.sorted_from(np.array(stamps, dtype=np.int64), np.array(translations), np.array(rotations))


def _vector(value: Any) -> Tuple[float, float, float]:
    return value.x, value.y, value.z


def _rotation(value: Any) -> Tuple[float, float, float, float]:
    return value.x, value.y, value.z, value.w
