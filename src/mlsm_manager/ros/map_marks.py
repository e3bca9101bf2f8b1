"""Named places of the map: set and deleted on MLSM/mark, shown on MLSM/marks, kept in the map's file."""

import threading
from typing import Iterable, List

import rospy
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from node_support import topics
from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.marks import Mark, Marks
from node_support.ros.callbacks import guarded

_LETTER = 1.0  # m
_COLOR = ColorRGBA(0.2, 0.8, 1.0, 1.0)
_QUEUE = 100


class MapMarks:
    """The marks of the map; whoever saves or loads the map asks here."""

    def __init__(self, map_frame: str, health: Health) -> None:
        self.changes = 0
        """Grows with each change by a message."""
        self._frame, self._marks, self._lock = map_frame, Marks(), threading.Lock()
        self._shown = rospy.Publisher(topics.MARKS, MarkerArray, queue_size=_QUEUE, latch=True)
        rospy.Subscriber(topics.SET_MARK, Marker, guarded(health, self._take), queue_size=_QUEUE)

    def all(self) -> List[Mark]:
        """Return the marks in the order in which they were set."""
        with self._lock:
            return self._marks.all()

    def replace(self, marks: Iterable[Mark]) -> None:
        """Take those of another map."""
        with self._lock:
            self._marks = Marks(marks)
            self._show()

    def _take(self, message: Marker) -> None:
        """Set the mark that a marker's text names at its place, or delete it."""
        if message.header.frame_id != self._frame:
            raise RefusedInput("marks refused", f"frame {message.header.frame_id!r}, must be {self._frame!r}")
        at = message.pose.position
        with self._lock:
            if message.action == Marker.DELETE:
                self._marks.delete(message.text)
            else:
                self._marks.set(Mark(message.text, at.x, at.y, at.z))
            self.changes += 1
            self._show()

    def _show(self) -> None:
        markers = [Marker(action=Marker.DELETEALL)]
        for number, mark in enumerate(self._marks.all()):
            one = Marker(header=Header(frame_id=self._frame), ns="marks", id=number, text=mark.name, color=_COLOR)
            one.type, one.scale.z, one.pose.orientation.w = Marker.TEXT_VIEW_FACING, _LETTER, 1.0
            one.pose.position.x, one.pose.position.y, one.pose.position.z = mark.x, mark.y, mark.z
            markers.append(one)
        self._shown.publish(MarkerArray(markers))
