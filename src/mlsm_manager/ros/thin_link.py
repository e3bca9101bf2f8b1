"""The map and the vehicle's place in it for a topside behind a link of few bytes a second."""

import threading
import time
from collections import Counter
from typing import Any, Callable, Dict, Hashable, Tuple

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Path
from sensor_msgs.msg import Image
from visualization_msgs.msg import Marker, MarkerArray

from node_support import topics
from node_support.ros.callbacks import every, guarded, make_health
from node_support.ros.reconfigurable_parameters import read_parameters
from node_support.thin_queue import ThinLinkParameters, ThinQueue

_DIAGNOSTICS = "/diagnostics"
_STEP = 0.25  # s: soon enough for a person
_QUEUE = 1000  # messages: none may be lost, for a tile comes again only when it changes
_HEADERS = 300  # bytes of a marker without its points: header, pose, scale, names
_POINT = 40  # bytes of a block: its place and its colour
_PLACE = 400  # bytes of a fix; a pose without covariance takes a quarter
_POSES = 100  # of a path: a line on the screen shows no more
_SIDE = 100  # pixels of the thinned image
_TELL = 60.0  # s between two lines of the log


class ThinLink(rospy.SubscribeListener):
    """Sends fixes at once, then what changed of the map, then all else, each as the newest there is."""

    def __init__(self) -> None:
        """Raises ParameterError."""
        self.health = make_health("thin_link")
        self._parameters = read_parameters(ThinLinkParameters, "~")
        self._queue = ThinQueue(self._parameters.bytes_per_second)
        self._lock = threading.Lock()
        self._known: Dict[Tuple[str, int], Marker] = {}
        self._sent_at: Dict[str, float] = {}
        self._bytes: Counter = Counter()
        self._publishers: Dict[str, rospy.Publisher] = {}
        self._pass_on(topics.MATCHED_POSE, PoseWithCovarianceStamped, self._take_pose)
        self._pass_on(topics.MAP_MARKERS, MarkerArray, self._take_map, self)
        self._pass_on(_DIAGNOSTICS, DiagnosticArray, self._seldom(_DIAGNOSTICS, lambda message: message))
        self._pass_on(topics.MATCHED_PATH, Path, self._seldom(topics.MATCHED_PATH, thinned_path))
        self._pass_on(topics.IMAGE, Image, self._seldom(topics.IMAGE, thinned_image))
        every(_STEP, self._send, self.health)

    def _pass_on(self, topic: str, kind: type, take: Callable[[Any], None], listener: Any = None) -> None:
        name = f"thin/{topic.strip('/')}"
        self._publishers[topic] = rospy.Publisher(name, kind, queue_size=_QUEUE, subscriber_listener=listener)
        rospy.Subscriber(topic, kind, guarded(self.health, take), queue_size=_QUEUE)

    def _take_pose(self, message: PoseWithCovarianceStamped) -> None:
        with self._lock:
            told, self._bytes = dict(self._bytes), Counter()
            self._put(topics.MATCHED_POSE, topics.MATCHED_POSE, message, 0)
        words = ", ".join(f"{topic} {number}" for topic, number in sorted(told.items())) or "nothing"
        self.health.show("bytes sent for the scan before", words)
        rospy.loginfo_throttle(_TELL, f"{self.health.name}: bytes sent for the scan before: {words}")

    def _take_map(self, message: MarkerArray) -> None:
        with self._lock:
            for marker in message.markers:
                key = (marker.ns, marker.id)
                if marker.action == Marker.DELETEALL:
                    self._queue.drop(list(self._known))
                    self._known.clear()
                elif marker.action == Marker.DELETE:
                    self._known.pop(key, None)
                else:
                    self._known[key] = marker
                self._put(topics.MAP_MARKERS, key, marker, 1 if marker.action == Marker.DELETEALL else 2)

    def _seldom(self, topic: str, thinned: Callable[[Any], Any]) -> Callable[[Any], None]:
        """Return what takes the messages of a topic, of which few are sent."""

        def take(message: Any) -> None:
            # Each node tells of itself.
            node = message._connection_header["callerid"]
            now = time.monotonic()
            if now - self._sent_at.get(topic + node, -np.inf) >= self._parameters.slow_period:
                self._sent_at[topic + node] = now
                with self._lock:
                    self._put(topic, topic + node, thinned(message), 3)

        return take

    def _put(self, topic: str, key: Hashable, message: Any, priority: int) -> None:
        self._queue.put(key, (topic, message), _size(message), priority)

    def peer_subscribe(self, *_: object) -> None:
        """Let the whole map wait once more, for who has just come."""
        with self._lock:
            for key, marker in self._known.items():
                self._put(topics.MAP_MARKERS, key, marker, 2)

    def _send(self) -> None:
        with self._lock:
            sent = self._queue.take(time.monotonic())
            for one in sent:
                self._bytes[one.item[0]] += one.size
        self.health.show("bytes waiting", str(self._queue.waiting_bytes))
        self.health.count("bytes sent", sum(one.size for one in sent))
        markers = [message for topic, message in (one.item for one in sent) if topic == topics.MAP_MARKERS]
        if markers:
            self._publishers[topics.MAP_MARKERS].publish(MarkerArray(markers))
        for topic, message in (one.item for one in sent):
            if topic != topics.MAP_MARKERS:
                self._publishers[topic].publish(message)


def _size(message: Any) -> int:
    if isinstance(message, Marker):
        return _HEADERS + _POINT * len(message.points)
    if isinstance(message, DiagnosticArray):
        return sum(len(item.key) + len(item.value) + 8 for status in message.status for item in status.values)
    if isinstance(message, Image):
        return len(message.data)
    return _PLACE if isinstance(message, PoseWithCovarianceStamped) else _PLACE * len(message.poses) // 4


def thinned_path(path: Path) -> Path:
    """Return the path with about a hundred of its poses, the newest included."""
    step = max(len(path.poses) // _POSES, 1)
    return Path(path.header, path.poses[::-1][::step][::-1])


def thinned_image(image: Image) -> Image:
    """Return the image with every n-th pixel of every n-th line, at most `_SIDE` on a side."""
    step = max(-(-max(image.width, image.height) // _SIDE), 1)
    pixels = np.frombuffer(image.data, dtype=np.uint8).reshape(image.height, image.step)
    depth = image.step // max(image.width, 1)
    kept = pixels[::step, : image.width * depth].reshape(-1, image.width, depth)[:, ::step]
    height, width = kept.shape[:2]
    return Image(image.header, height, width, image.encoding, image.is_bigendian, width * depth, kept.tobytes())
