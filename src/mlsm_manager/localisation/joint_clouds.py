"""Clouds for the map that is shown beside a joint run: each is placed, waits, or is left out."""

from collections import deque
from typing import Deque, Optional

import numpy as np

from mlsm_manager.localisation.correction_history import CorrectionHistory
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_map import Drawn, KeyframeMap
from mlsm_manager.localisation.map_updates import MOST_WAITING, NOTHING_INSERTED, CloudUpdate
from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.localisation.uncarved_clouds import UncarvedClouds
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import composed, transformed


class JointClouds:
    """A cloud that reaches beyond the newest scan waits until the scan of its time is solved.

    While scans are not matched it is inserted where the odometry puts it, and carves once the scan of its time tells
    where the vehicle was.
    """

    def __init__(self, shown: KeyframeMap) -> None:
        self._shown = shown
        self._waiting: Deque[TimedPoints] = deque(maxlen=MOST_WAITING)
        self._history = CorrectionHistory()
        self._uncarved = UncarvedClouds()
        self._found_at = -np.inf

    def found(self, time: float) -> None:
        """Leave out clouds from before `time` [s], when the vehicle's place was found.

        Nobody knows how far the odometry strayed until then.
        """
        self._found_at = time

    def learn_path(self, times: np.ndarray, T_map_odom: np.ndarray, track: Track) -> None:
        """Learn that the vehicle moved at increasing `times` (b,) [s] as T_map_odom (3,) and the odometry say."""
        self._history.add(times, composed(T_map_odom, track.at(times)), track, holds=True)

    def origins(self, times: np.ndarray, sonar_in_base: np.ndarray) -> Optional[np.ndarray]:
        """Return where in map (n, 2) m a sonar at (2,) m in base_link was at `times` (n,) [s]; None if unknown."""
        return self._history.origins(times, sonar_in_base)

    def place(self, cloud: TimedPoints, T_map_odom: np.ndarray, sonar_in_base: np.ndarray) -> CloudUpdate:
        """Insert a cloud where the odometry puts it; it was heard from (2,) m in base_link."""
        origins = self.origins(cloud.times, sonar_in_base)
        if origins is None:
            self._uncarved.append(transformed(T_map_odom, cloud.points), cloud.times)
        return self._inserted(cloud, T_map_odom, origins)

    def carve_next(self, sonar_in_base: np.ndarray) -> Optional[CloudUpdate]:
        """Carve with the next cloud that was placed before the scan of its time came; None when there is none."""
        return self._uncarved.carve_next(self._history, sonar_in_base, self._shown.carve)

    def forget_uncarved(self) -> None:
        """Never carve with clouds that were placed already."""
        self._uncarved.clear()

    def take(self, cloud: TimedPoints, session: Optional[JointSession]) -> CloudUpdate:
        """Insert a cloud as a keyframe of the run; without a run it waits for one."""
        if cloud.end <= self._found_at:
            return CloudUpdate(NOTHING_INSERTED, False, len(cloud))
        if session is not None and cloud.end <= session.start:
            return self._inserted(cloud, session.T_map_odom, None)
        if session is None or cloud.end > session.known_until:
            self._waiting.append(cloud)
            return CloudUpdate(NOTHING_INSERTED, True, 0)
        self._shown.add(cloud)
        return _cloud_update(self._shown.draw(session, session.settled_until))

    def next_until(self, time: float) -> Optional[TimedPoints]:
        """Return the next cloud that waited and ends by `time` [s], which then waits no more; None without one."""
        return self._waiting.popleft() if self._waiting and self._waiting[0].end <= time else None

    def _inserted(self, cloud: TimedPoints, T_map_odom: np.ndarray, origins: Optional[np.ndarray]) -> CloudUpdate:
        points = transformed(T_map_odom, cloud.points)
        return _cloud_update(self._shown.insert_cloud(points, cloud.times, origins))


def _cloud_update(drawn: Drawn) -> CloudUpdate:
    return CloudUpdate(drawn.report, False, 0, drawn.carved)
