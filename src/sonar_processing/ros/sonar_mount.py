"""Publishes where the sonar is mounted, where nothing else does."""

import time
from typing import Dict, Optional

import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3

from node_support.geometry import quaternion_of
from node_support.ros.transforms import TfBuffer
from sonar_processing.beams.mounting import MountingParameters

_PATIENCE = 0.5  # s: whoever knows the frame and has started sends it at once, because /tf_static is latched
_FEWEST = 10  # Beams of one frame that wait: a few may be broken messages


class SonarMount:
    """Fixes the frame of the beams to the vehicle as the parameters say; once, and only a frame that tf lacks."""

    def __init__(self, parameters: MountingParameters, name: str) -> None:
        """`name`: of the node, for its log."""
        self._parameters = parameters
        self._name = name
        self._missing_since: Dict[str, float] = {}
        self._broadcaster: Optional[tf2_ros.StaticTransformBroadcaster] = None

    @property
    def is_wanted(self) -> bool:
        """Whether a frame may still have to be mounted."""
        return bool(self._parameters.mounted_in) and self._broadcaster is None

    def look_at(self, waiting: Dict[str, int], transforms: TfBuffer) -> None:
        """Mount a frame of which many beams have been waiting for a while. waiting: beams by frame."""
        if not self.is_wanted:
            return
        now = time.monotonic()
        for frame, beams in waiting.items():
            if beams < _FEWEST or transforms.knows(frame):
                self._missing_since.pop(frame, None)
            elif now - self._missing_since.setdefault(frame, now) >= _PATIENCE:
                self._mount(frame)
                return

    def _mount(self, frame: str) -> None:
        self._broadcaster = tf2_ros.StaticTransformBroadcaster()
        self._broadcaster.sendTransform(_transform(self._parameters, frame))
        one = self._parameters
        rospy.logwarn(
            "%s: tf does not know %s: it is mounted in %s at %g %g %g m, yaw %g rad%s, as mount_* say",
            self._name, frame, one.mounted_in, one.mount_x, one.mount_y, one.mount_z, one.mount_yaw,
            ", upside down" if one.upside_down else "",
        )  # fmt: skip


def _transform(parameters: MountingParameters, frame: str) -> TransformStamped:
    pose = parameters.matrix()
    made = TransformStamped(child_frame_id=frame)
    made.header.frame_id = parameters.mounted_in
    made.transform.translation = Vector3(*pose[:3, 3])
    made.transform.rotation = Quaternion(*quaternion_of(pose))
    return made
