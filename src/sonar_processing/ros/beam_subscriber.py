"""Subscribes to beams of any known message type, also of packages that are not installed."""

from typing import Callable

import numpy as np
import rospy
from sensor_msgs.msg import LaserScan

from node_support import topics
from node_support.health import Health
from node_support.ros.callbacks import MessageClasses, guarded
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.beam_types import BEAM_TYPES, LASER_SCAN, UNLIKELY
from sonar_processing.beams.reader import BeamMessageParameters, BeamReader, Reading, beam_type
from sonar_processing.beams.steady_head import SteadyHead
from underwater_map_construction.msg import SonarScanLine

_BUFFER_BYTES = 2**20  # thousands of beams: what comes while the process stands still for some seconds


class BeamSubscriber:
    """Calls back with every beam, in whichever of the known types it comes; angles that tremble are made steady."""

    def __init__(
        self,
        take: Callable[[Beam], None],
        parameters: BeamMessageParameters,
        health: Health,
        on_new_unit: Callable[[], None] = lambda: None,
        on_message: Callable[[int], None] = lambda _: None,
    ) -> None:
        """`on_new_unit` is called when the angles of the beams so far turn out to be in another unit, `on_message` with
        the number of beams of a message before they come.
        """
        self._take = guarded(health, take)
        self._health = health
        self._on_new_unit, self._on_message = on_new_unit, on_message
        self._reader = BeamReader(parameters)
        self._head = SteadyHead()
        self._classes = MessageClasses((SonarScanLine, LaserScan))
        self._subscriber = rospy.Subscriber(
            topics.BEAMS,
            rospy.AnyMsg,
            guarded(health, self._take_message, topics.BEAMS),
            # Of a buffer with more messages than a queue has places, rospy would drop the oldest without a word.
            queue_size=None,
            buff_size=_BUFFER_BYTES,
            tcp_nodelay=True,
        )

    def unregister(self) -> None:
        self._subscriber.unregister()
        self._health.need_no_more(self._subscriber.resolved_name)

    def _take_message(self, message: rospy.AnyMsg) -> None:
        self._health.count("messages in")
        kind = message._connection_header["type"]
        beam_type(kind)
        reading = self._reader.read(kind, self._classes.deserialised(message))
        self._tell(kind, reading)
        self._health.count("beams in", len(reading.beams))
        self._on_message(len(reading.beams))
        for beam in reading.beams:
            for steady in self._head.add(beam):
                self._take(steady)

    def _tell(self, kind: str, reading: Reading) -> None:
        for note in reading.notes:
            rospy.logwarn("%s: %s", self._health.name, note)
        if kind == LASER_SCAN and reading.notes:
            rospy.logwarn("%s: %s", self._health.name, _topics_instead())
        if reading.refused:
            self._health.problem(
                "beams refused", f"rays of a {kind} that make no beam; see the driver", reading.refused
            )
        if reading.unit_changed:
            self._health.problem("changes of the unit of angles", "the unfinished scan is forgotten; set angle_unit")
            self._head = SteadyHead()
            self._on_new_unit()
        if self._head.trembles:
            told = f"by {np.degrees(self._head.deviation):.0f} deg; those of a steady turn are taken instead"
            self._health.problem("beams of which the head's angles tremble", told, len(reading.beams))


def _topics_instead() -> str:
    found = [f"{topic} ({kind})" for topic, kind in rospy.get_published_topics() if kind in {*BEAM_TYPES} - {*UNLIKELY}]
    if found:
        return f"take the beams themselves instead of the LaserScan: remap {topics.BEAMS} to {' or '.join(found)}"
    return "let the driver publish its beams, and take them instead of the LaserScan"
