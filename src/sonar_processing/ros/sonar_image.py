"""The ROS side of sonar_image: draws beams into an image while somebody subscribes to it."""

import threading
import time
from typing import Optional

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image

from node_support import topics
from node_support.ros.callbacks import make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from sonar_processing.beams.beam import Beam
from sonar_processing.ros.beam_subscriber import BeamSubscriber
from sonar_processing.ros.conversions import header
from sonar_processing.scans.image import PolarImage, SonarImageParameters

QUEUE_SIZE = 2  # Who is slow sees fewer images and not old ones


class SonarImage(rospy.SubscribeListener):
    """Listens to the beams only while the image is subscribed to."""

    def __init__(self, namespace: str = "~") -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        super().__init__()
        self.health = make_health("sonar_image")
        self._lock = threading.Lock()
        self._drawing = threading.Lock()
        self._beams: Optional[BeamSubscriber] = None
        self._next_image = 0.0
        self._live = ReconfigurableParameters(SonarImageParameters, namespace, self.health, self._use_parameters)
        self._infos = rospy.Publisher(topics.CAMERA_INFO, CameraInfo, queue_size=QUEUE_SIZE)
        self._images = rospy.Publisher(topics.IMAGE, Image, queue_size=QUEUE_SIZE, subscriber_listener=self)
        # rospy takes connections before it knows the listener, and tells it of none that came so early.
        if self._images.get_num_connections():
            self.peer_subscribe()

    def _use_parameters(self, parameters: SonarImageParameters) -> None:
        self._picture = PolarImage(parameters)

    def peer_subscribe(self, *_: object) -> None:
        with self._lock:
            if self._beams is None:
                self._clear()
                self._beams = BeamSubscriber(self._take, self._live.current, self.health, self._clear)

    def peer_unsubscribe(self, _topic: str, others: int) -> None:
        with self._lock:
            if others == 0 and self._beams is not None:
                self._beams.unregister()
                self._beams = None

    def _clear(self) -> None:
        with self._drawing:
            self._picture.clear()

    def _take(self, beam: Beam) -> None:
        picture = self._picture
        # Each connection has a thread of its own, and several sonars may send beams of several lengths.
        with self._drawing, self.health.timed():
            image = picture.draw(beam)
            now = time.monotonic()
            if now >= self._next_image:
                self._next_image = now + 1.0 / self._live.current.max_rate
                self._publish(image, picture.metres_per_pixel, beam)

    def _publish(self, image: np.ndarray, metres_per_pixel: float, beam: Beam) -> None:
        self.health.count("images")
        stamped = header(beam.stamp_ns, beam.frame_id)
        side = len(image)
        self._images.publish(
            Image(header=stamped, height=side, width=side, encoding="mono8", step=side, data=image.tobytes())
        )
        if self._infos.get_num_connections():
            self._infos.publish(_camera_info(stamped, side, 1.0 / metres_per_pixel))


def _camera_info(stamped: object, side: int, pixels_per_metre: float) -> CameraInfo:
    """Return where the head is in the image (cx, cy) and how many pixels make a metre (fx, fy)."""
    middle = (side - 1) / 2.0
    return CameraInfo(
        header=stamped,
        height=side,
        width=side,
        distortion_model="plumb_bob",
        D=[0.0] * 5,
        K=[pixels_per_metre, 0.0, middle, 0.0, pixels_per_metre, middle, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[pixels_per_metre, 0.0, middle, 0.0, 0.0, pixels_per_metre, middle, 0.0, 0.0, 0.0, 1.0, 0.0],
    )
