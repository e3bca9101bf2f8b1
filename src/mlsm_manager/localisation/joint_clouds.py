"""Clouds for the map that is shown while a joint run follows the vehicle: each is placed, waits, or is left out."""

from collections import deque
from typing import Deque, Optional

import numpy as np

from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_map import Drawn, KeyframeMap
from mlsm_manager.localisation.map_updates import MOST_WAITING, NOTHING_INSERTED, CloudUpdate
from mlsm_manager.localisation.timed_points import TimedPoints
from node_support.geometry.planar import transformed


class JointClouds:
    """A cloud that reaches beyond the newest scan waits until the scan of its time is solved."""

    def __init__(self, shown: KeyframeMap) -> None:
        self._shown = shown
        self._waiting: Deque[TimedPoints] = deque(maxlen=MOST_WAITING)
        self._found_at = -np.inf

    def found(self, time: float) -> None:
        """Leave out clouds from before `time` [s], when the vehicle's place was found.

        Nobody knows how far the odometry strayed until then.
        """
        self._found_at = time

    def place(self, cloud: TimedPoints, T_map_odom: np.ndarray, origins: Optional[np.ndarray]) -> CloudUpdate:
        """Insert a cloud where the odometry puts it; origins: (n, 2) m in map where it was heard, None if unknown."""
        points = transformed(T_map_odom, cloud.points)
        return _cloud_update(self._shown.insert_cloud(points, cloud.times, origins))

    def take(self, cloud: TimedPoints, session: Optional[JointSession]) -> CloudUpdate:
        """Insert a cloud as a keyframe of the run; without a run it waits for one."""
        if cloud.end <= self._found_at:
            return CloudUpdate(NOTHING_INSERTED, False, len(cloud))
        if session is not None and cloud.end <= session.start:
            return self.place(cloud, session.T_map_odom, None)
        if session is None or cloud.end > session.known_until:
            self._waiting.append(cloud)
            return CloudUpdate(NOTHING_INSERTED, True, 0)
        self._shown.add(cloud)
        return _cloud_update(self._shown.draw(session, session.settled_until))

    def next_until(self, time: float) -> Optional[TimedPoints]:
        """Return the next cloud that waited and ends by `time` [s], which then waits no more; None without one."""
        return self._waiting.popleft() if self._waiting and self._waiting[0].end <= time else None


def _cloud_update(drawn: Drawn) -> CloudUpdate:
    return CloudUpdate(drawn.report, False, 0, drawn.carved)
